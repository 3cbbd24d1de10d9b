"""Who may talk to the page: by which name it was asked for, from which page, and with which token."""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import re
import secrets
import socket
from collections.abc import Iterable
from dataclasses import dataclass
from urllib.parse import urlsplit

from demo_tool.errors import DemoToolError

MIN_TOKEN = 16
_TOKEN = re.compile(rf"[A-Za-z0-9_-]{{{MIN_TOKEN},}}")
_LOOPBACK_NAMES = frozenset({"localhost", "localhost.localdomain"})


class AccessError(DemoToolError):
    """Settings of access that would leave the page open, or that nobody could use."""


@dataclass(frozen=True)
class AccessRule:
    """What is let in. Loopback alone needs no token; then only loopback's names may stand in the Host header.

    The port in the Host header is free: through a tunnel it differs. A foreign name there means that another site's
    name was pointed at this machine (DNS rebinding), a foreign Origin that another site's page asks.
    """

    names: frozenset[str]
    any_address: bool
    token: str | None

    @classmethod
    def for_address(cls, host: str, token: str | None, more_names: Iterable[str] = ()) -> AccessRule:
        """The rule for a server that listens on `host`; makes a token where one is needed and none is given.

        Raises:
            AccessError: on a token that could be guessed, or that has no place in an address.
        """
        loopback = _is_loopback(host)
        if token is None and not loopback:
            token = secrets.token_urlsafe(MIN_TOKEN)
        if token is not None and not _TOKEN.fullmatch(token):
            raise AccessError(
                f"the token has {len(token)} characters; it takes {MIN_TOKEN} or more of A-Z, a-z, 0-9, - and _,"
                " or leave --token away, then one is made"
            )
        names = {name.lower() for name in more_names} | _LOOPBACK_NAMES
        if not loopback:
            own = socket.gethostname().lower()
            names |= {host.lower(), own, f"{own}.local", socket.getfqdn().lower()}
        return cls(frozenset(names), not loopback, token)

    def knows_host(self, header: str) -> bool:
        """Whether the Host header names this server."""
        try:
            name = urlsplit(f"//{header}").hostname or ""
        except ValueError:
            return False
        return name in self.names or _is_loopback(name) or (self.any_address and _is_address(name))

    def knows_origin(self, origin: str | None, host: str, demanded: bool) -> bool:
        """Whether a request with this Origin header (None: without) comes from a page of this server."""
        if origin is None:
            return not demanded
        return origin.lower() in {f"http://{host.lower()}", f"https://{host.lower()}"}

    def knows_token(self, token: str | None) -> bool:
        """Whether the token is the right one, or none is demanded."""
        return self.token is None or hmac.compare_digest((token or "").encode(), self.token.encode())

    def knows_cookie(self, cookie: str | None) -> bool:
        """Whether the cookie is one that `cookie` gave, or none is demanded."""
        return self.token is None or hmac.compare_digest((cookie or "").encode(), self.cookie().encode())

    def cookie(self) -> str:
        """What a browser keeps once it has shown the token; it outlives a restart with the same token."""
        return hashlib.sha256(f"demo_tool page {self.token}".encode()).hexdigest()


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _is_loopback(name: str) -> bool:
    return name in _LOOPBACK_NAMES or (_is_address(name) and ipaddress.ip_address(name).is_loopback)
