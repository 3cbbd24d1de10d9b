"""Draft of the next step: the ends of the action that are drawn so far."""

from __future__ import annotations

from dataclasses import dataclass, replace

from cliport_episodes.demonstration import PixelBox, Source


@dataclass(frozen=True)
class End:
    """Pick or place as drawn; position: (x, y) [m, base frame] of the policy's proposal, in place of the box's own."""

    box: PixelBox
    rotation: int
    position: tuple[float, float] | None = None

    def moved_to(self, box: PixelBox, rotation: int) -> End:
        """Return the end with another box or rotation; the policy's position stays as long as the box does."""
        return End(box, rotation, self.position if box == self.box else None)


@dataclass(frozen=True)
class Draft:
    """Pick and place of the next step, as far as they are drawn; proposed: the policy's pick and place."""

    pick: End | None = None
    place: End | None = None
    proposed: tuple[End, End] | None = None

    def with_end(self, which: str, box: PixelBox, rotation: int) -> Draft:
        """Return the draft with the end `which`, "pick" or "place", drawn anew."""
        old: End | None = getattr(self, which)
        end = End(box, rotation) if old is None else old.moved_to(box, rotation)
        return replace(self, pick=end) if which == "pick" else replace(self, place=end)

    @property
    def source(self) -> Source:
        """Origin of the choice: the person, the policy or both."""
        if self.proposed is None:
            return Source.CLICKED
        return Source.PROPOSED if self.proposed == (self.pick, self.place) else Source.CORRECTED


def proposed_draft(pick: End, place: End) -> Draft:
    """Make a draft of the policy's proposal."""
    return Draft(pick, place, (pick, place))
