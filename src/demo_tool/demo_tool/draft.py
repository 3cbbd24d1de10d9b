"""What has been drawn so far for the next step."""

from __future__ import annotations

from dataclasses import dataclass, replace

from cliport_episodes.demonstration import PixelBox, Source


@dataclass(frozen=True)
class End:
    """A box and a rotation; position: (x, y) [m, base frame] where the policy named one, instead of the box's own."""

    box: PixelBox
    rotation: int
    position: tuple[float, float] | None = None

    def moved_to(self, box: PixelBox, rotation: int) -> End:
        """What a person made of it: the policy's position stays as long as the box does."""
        return End(box, rotation, self.position if box == self.box else None)


@dataclass(frozen=True)
class Draft:
    """Pick and place of the next step, as far as they are drawn; proposed: as the policy had them."""

    pick: End | None = None
    place: End | None = None
    proposed: tuple[End, End] | None = None

    def with_end(self, which: str, box: PixelBox, rotation: int) -> Draft:
        """With the end `which`, "pick" or "place", drawn."""
        old: End | None = getattr(self, which)
        end = End(box, rotation) if old is None else old.moved_to(box, rotation)
        return replace(self, pick=end) if which == "pick" else replace(self, place=end)

    @property
    def source(self) -> Source:
        """Whose choice this is."""
        if self.proposed is None:
            return Source.CLICKED
        return Source.PROPOSED if self.proposed == (self.pick, self.place) else Source.CORRECTED


def proposed_draft(pick: End, place: End) -> Draft:
    """A draft that is the policy's."""
    return Draft(pick, place, (pick, place))
