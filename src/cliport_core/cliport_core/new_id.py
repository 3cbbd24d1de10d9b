"""Ids that people read and type: of plans and proposals."""

from __future__ import annotations

import uuid


def new_id() -> str:
    """Return eight hexadecimal digits that were not used before, as far as chance allows."""
    return uuid.uuid4().hex[:8]
