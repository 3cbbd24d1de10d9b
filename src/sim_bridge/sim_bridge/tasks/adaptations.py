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
    Adaptation(
        "packing-box-pairs, packing-boxes",
        "a container is cut again, or drawn again, until each box has a side of at most 72 mm",
        "the hand opens 80 mm",
        "none; other cuts in 28 % of the containers",
    ),
    Adaptation(
        "packing-box-pairs, packing-boxes, packing-google-objects",
        "containers and what belongs into them lie where their outline fits, boxes 24 mm and objects 30 mm apart",
        "discs around them do not fit into the workspace; an opened finger must",
        "none; a container over 27 cm lies nearly along the table",
    ),
    Adaptation(
        "packing-google-objects",
        "objects of the project's own, or from a folder that the user gives; 100 g, friction 1, rolling friction 2 mm",
        "no meshes are copied; the original's masses are unknown; round things must lie still",
        "another set is another task: results name it",
    ),
    Adaptation(
        "packing-google-objects",
        "an object is no longer than its cell, no thinner than 20 mm, and made smaller, to 61 % at least, until it is "
        "narrow enough somewhere as it lies; it falls in any attitude; one without room for the hand is left out",
        "the hand opens 80 mm and needs something to hold; the original's attitude is a slip (section 14)",
        "none: points fill the box around whatever it is; none of the project's own is made smaller, 17 % of Google's",
    ),
    Adaptation(
        "packing-google-objects",
        "the expert puts an object beside what lies in the container, a little turned if need be, not onto its middle",
        "what a hand lets go on top of others slides to the walls and leans over them",
        "none: the zone is the container",
    ),
)
