"""What differs from the benchmark's specification, why, and what that does to the metric: the whole list."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Adaptation:
    """tasks: names without variant, "all" for every one."""

    tasks: str
    what: str
    why: str
    effect: str


ADAPTATIONS: tuple[Adaptation, ...] = (
    Adaptation(
        "all",
        "workspace 0.4 x 0.8 m instead of 0.5 x 1.0 m",
        "the hand, pointing down, reaches all of it",
        "none; denser scenes",
    ),
    Adaptation(
        "all",
        "a thing's disc, not the square around it, must be free, with 30 mm beside what is to be grasped",
        "an opened finger must fit beside it",
        "none; less occlusion",
    ),
    Adaptation(
        "all",
        "pick at the middle between the jaws' contacts, with a yaw from the geometry",
        "a parallel hand has a yaw and needs something narrow",
        "none: only where things end up is scored",
    ),
    Adaptation(
        "all",
        "one generator draws everything; palettes are not shuffled in place",
        "the original leaves colours and zones unseeded",
        "none; a seed is the whole scene",
    ),
    Adaptation(
        "all",
        "the expert turns a thing to the nearest of its equal yaws with room for the fingers",
        "the wrist's range and the fingers",
        "none: the metric knows the same symmetries",
    ),
    Adaptation(
        "put-blocks-in-bowls, place-red-in-green",
        "a bowl's pose is its middle; it collides as 15 wall pieces and a floor; a block weighs 30 g",
        "the original mesh lies 26 mm off its pose; fingers and blocks go into bowls; steadier grasps",
        "the 5 cm disc is centred on the bowl",
    ),
    Adaptation(
        "put-blocks-in-bowls",
        "a sentence may name the goal; blocks are placed without a turn",
        "chosen goals for demonstrations; the wrist need not turn",
        "none: yaw is not scored",
    ),
    Adaptation(
        "towers-of-hanoi-seq, towers-of-hanoi",
        "rings 50, 60 and 70 mm across and 20 mm thick (not 60, 70, 80 and 10); pegs 30 mm tall (not 50); no turn",
        "the hand opens 80 mm; its fingers hold one ring and not the one below; a tall peg hides the rings from them",
        "none: x and y within 1 cm",
    ),
    Adaptation(
        "block-insertion",
        "the fixture's walls are 20 mm tall, not 40",
        "the fingers, thicker than the clearance of 10 mm, pass over them beside the block",
        "none: pose within 1 cm and 15 degrees",
    ),
    Adaptation(
        "align-box-corner",
        "a box is drawn again until one side is at most 72 mm",
        "the hand opens 80 mm",
        "none; boxes are narrower than in the original",
    ),
    Adaptation(
        "palletizing-boxes",
        "25 mm between the boxes' long sides, not 10; boxes appear lying on the table; both places at x = 0.45 m",
        "the fingers open beside a box, whose ends are too far apart for them; the workspace is smaller",
        "none: the zone is the pallet",
    ),
    Adaptation(
        "assembling-kits-seq, assembling-kits, packing-unseen-shapes",
        "shapes have outlines of the project's own and collide with their holes and notches, not as convex hulls",
        "no meshes are copied; jaws meet the faces that are seen",
        "none: extents and periods are the specification's; the triangle's 120 degrees count, the expert avoids them",
    ),
    Adaptation(
        "assembling-kits-seq, assembling-kits",
        "a kit's prints are only seen, without the edge of 0.9 mm; a kit lies anywhere where it fits as it is turned",
        "what lies half on an edge tilts or stops at it; the disc around a kit fills the workspace's width",
        "none: heights do not count",
    ),
)
