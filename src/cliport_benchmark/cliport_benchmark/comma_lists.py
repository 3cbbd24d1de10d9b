"""Values of options with commas between, as numbers."""

from __future__ import annotations

from cliport_benchmark.errors import OptionError


def whole_numbers(option: str, text: str) -> tuple[int, ...]:
    """Return the numbers of an option's text.

    Raises:
        OptionError: for what is no whole number.
    """
    try:
        return tuple(int(part) for part in text.split(",") if part)
    except ValueError:
        raise OptionError(f"{option} must be whole numbers with commas between, got {text}") from None
