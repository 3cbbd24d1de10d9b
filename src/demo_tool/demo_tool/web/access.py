"""Access to the page: the accepted Host names, Origins and token."""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import os
import re
import secrets
import socket
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from demo_tool.errors import DemoToolError

MIN_TOKEN = 16
_TOKEN = re.compile(rf"[A-Za-z0-9_-]{{{MIN_TOKEN},}}")
_LOOPBACK_NAMES = frozenset({"localhost", "localhost.localdomain"})


class AccessError(DemoToolError):
    """Access settings that would leave the page open, or that nobody could use."""


@dataclass(frozen=True)
class AccessRule:
    """Rule for requests. Only loopback needs no token; then the Host header must have one of loopback's names.

    The port in the Host header is not compared: through a tunnel it differs. A foreign name there means that another
    site's name was pointed at this machine (DNS rebinding), a foreign Origin that another site's page asks.
    """

    names: frozenset[str]
    any_address: bool
    token: str | None

    @classmethod
    def for_address(
        cls, host: str, token: str | None, more_names: Iterable[str] = (), ask_token: bool = False
    ) -> AccessRule:
        """Return the rule for a server that listens on `host`, with a new token where one is needed and none is given.

        more_names: further names of this machine; ask_token: on loopback too, where other people use this machine.

        Raises:
            AccessError: when the token could be guessed, or cannot be part of an address.
        """
        loopback = _is_loopback(host)
        if token is None and (ask_token or not loopback):
            token = secrets.token_urlsafe(MIN_TOKEN)
        if token is not None and not _TOKEN.fullmatch(token):
            raise AccessError(
                f"the token has {len(token)} characters; it takes {MIN_TOKEN} or more of A-Z, a-z, 0-9, - and _,"
                " or leave --token-file away, then one is made"
            )
        names = {name.lower() for name in more_names} | _LOOPBACK_NAMES
        if not loopback:
            own = socket.gethostname().lower()
            names |= {host.lower(), own, f"{own}.local", socket.getfqdn().lower()}
        return cls(frozenset(names), not loopback, token)

    def knows_host(self, header: str) -> bool:
        """Return True if the Host header names this server."""
        try:
            name = urlsplit(f"//{header}").hostname or ""
        except ValueError:
            return False
        return name in self.names or _is_loopback(name) or (self.any_address and _is_address(name))

    def knows_origin(self, origin: str | None, host: str, demanded: bool) -> bool:
        """Return True if a request with this Origin header comes from a page of this server.

        origin: None where there is no such header, which is accepted unless it is demanded; host: the Host header.
        """
        if origin is None:
            return not demanded
        return origin.lower() in {f"http://{host.lower()}", f"https://{host.lower()}"}

    def knows_token(self, token: str | None) -> bool:
        """Return True if the token is right, or none is demanded."""
        return self.token is None or hmac.compare_digest((token or "").encode(), self.token.encode())

    def knows_cookie(self, cookie: str | None) -> bool:
        """Return True if the cookie is that of `cookie`, or none is demanded."""
        return self.token is None or hmac.compare_digest((cookie or "").encode(), self.cookie().encode())

    def cookie(self) -> str:
        """Return the cookie of a browser that has shown the token; it outlives a restart with the same token."""
        return hashlib.sha256(f"demo_tool page {self.token}".encode()).hexdigest()


def token_from(path: Path) -> str:
    """Read the token in a file that only its owner reads; a new one is written where there is no file.

    Raises:
        AccessError: when others can read the file, or it cannot be read or written.
    """
    try:
        if not path.exists():
            token = secrets.token_urlsafe(MIN_TOKEN)
            with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
                file.write(token + "\n")
            return token
        if path.stat().st_mode & 0o077:
            raise AccessError(f"others may read the token in {path}: run chmod 600 {path}")
        return path.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise AccessError(f"the token file {path} cannot be used ({error}): name another with --token-file") from None


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _is_loopback(name: str) -> bool:
    return name in _LOOPBACK_NAMES or (_is_address(name) and ipaddress.ip_address(name).is_loopback)
