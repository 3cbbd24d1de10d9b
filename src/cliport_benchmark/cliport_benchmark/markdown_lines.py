"""Rows of the Markdown tables of results and experiments."""

from __future__ import annotations

from collections.abc import Sequence


def number(value: float | None) -> str:
    """Return a score with one decimal, "" for none."""
    return "" if value is None else f"{value:.1f}"


def count(value: int | None) -> str:
    """Return a number of scenes; "unknown" where nobody counted."""
    return "unknown" if value is None else str(value)


def table_line(cells: Sequence[str]) -> str:
    """Return a row of a Markdown table."""
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
