"""Edits of a recorded episode; they are kept in metadata.yaml, beside the raw files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field

from cliport_episodes.errors import BagError, LaterFormatError

FORMAT = "1"
SETUP = "setup"  # key of `custom_data` under which an episode carries its setup
MARKS: Mapping[str, bool | None] = {"success": True, "failure": False, "unmarked": None}  # by their words
_KEYS = {"cliport_format", "success", "finished", "instructions", "first", "last", "notes", "edited_ns", SETUP}
_SUCCESS = {"true": True, "false": False, "unmarked": None}


def verdict_words(success: bool | None) -> str:
    """Return the word for an episode's mark; None: nobody judged."""
    return next(word for word, mark in MARKS.items() if mark is success)


@dataclass(frozen=True)
class Edits:
    """Marks, relabelled instructions and trims of an episode.

    success: None where nobody judged. instructions: by step number, where relabelled. first, last: the numbers of the
    first and the last step that count; None: from the beginning, to the end. edited_ns: when an edit was made last,
    since the epoch; 0: never, or by a version that did not say. others: what later versions of this software added.
    """

    success: bool | None = None
    finished: bool = False
    instructions: Mapping[int, str] = field(default_factory=dict)
    first: int | None = None
    last: int | None = None
    notes: str = ""
    edited_ns: int = 0
    others: Mapping[str, str] = field(default_factory=dict)

    def keeps(self, step: int) -> bool:
        """Return True if a step is left after trimming."""
        return (self.first is None or step >= self.first) and (self.last is None or step <= self.last)

    def to_custom_data(self) -> dict[str, str]:
        """Return the edits as `custom_data` of metadata.yaml, which is text only."""
        data = {
            **self.others,
            "cliport_format": FORMAT,
            "success": next(word for word, value in _SUCCESS.items() if value is self.success),
            "finished": str(self.finished).lower(),
        }
        if self.instructions:
            by_step = {str(step): text for step, text in sorted(self.instructions.items())}
            data["instructions"] = json.dumps(by_step, ensure_ascii=False)
        for name, value in (("first", self.first), ("last", self.last)):
            if value is not None:
                data[name] = str(value)
        if self.edited_ns:
            data["edited_ns"] = str(self.edited_ns)
        return {**data, "notes": self.notes} if self.notes else data

    @classmethod
    def from_custom_data(cls, data: Mapping[str, str]) -> Edits:
        """Parse the edits that `to_custom_data` wrote; other keys are kept as they are.

        Raises:
            LaterFormatError: when the format is another one. BagError: when a value is not usable.
        """
        try:
            if data["cliport_format"] != FORMAT:
                raise LaterFormatError(
                    f"it has format {data['cliport_format']}, and {FORMAT} is known here: update this software"
                )
            return cls(
                success=_SUCCESS[data["success"]],
                finished=data.get("finished") == "true",
                instructions={int(k): str(v) for k, v in json.loads(data.get("instructions", "{}")).items()},
                first=int(data["first"]) if "first" in data else None,
                last=int(data["last"]) if "last" in data else None,
                notes=data.get("notes", ""),
                edited_ns=int(data.get("edited_ns", "0")),
                others={key: text for key, text in data.items() if key not in _KEYS},
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise BagError(f"what was edited cannot be read ({type(error).__name__}: {error})") from None
