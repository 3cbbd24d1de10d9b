"""Differences from the original benchmark's tasks, their reasons, and their effect on the metric.

See also docs/benchmark.md, "What is adapted".
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Adaptation:
    """One difference. tasks: names without variant, "all" for every one."""

    tasks: str
    what: str
    why: str
    effect: str


ADAPTATIONS: tuple[Adaptation, ...] = (
    Adaptation(
        "all",
        "workspace 0.4 x 0.8 m about x = 0.45 m instead of 0.5 x 1.0 m about 0.5; so are the piles; pixels of 2.5 mm "
        "instead of 3.125",
        "the hand, pointing down, reaches all of it",
        "none on the metric; denser scenes, the same things cover a quarter more pixels a side",
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
        "a parallel hand has a yaw and needs something narrow; the original picks any pixel of the thing that is seen",
        "none on the metric; picks of demonstrations are centred: with less entropy they are easier to learn",
    ),
    Adaptation(
        "all",
        "the hand centres its grasp on what is seen, and puts that at the place",
        "fingers centre a thing when they close; the paper's real robot does the same",
        "flatters: a pick beside the middle costs nothing; evaluate --exact-offset places as far off as was picked",
    ),
    Adaptation(
        "all",
        "one generator draws everything, seeded with task, split and seed; palettes are not shuffled in place",
        "the original leaves colours and zones unseeded, and tells splits apart by even and odd seeds",
        "none; a seed is the whole scene, and another one than the original's",
    ),
    Adaptation(
        "all",
        "the expert turns a thing to the nearest of its equal yaws with room for the fingers",
        "the wrist's range and the fingers",
        "none on the metric, which knows the same symmetries; turns of demonstrations are small: less entropy to learn",
    ),
    Adaptation(
        "all",
        "one camera, noisy in colour and depth, instead of three without noise",
        "one camera is what a table has",
        "harder: what is hidden from it, and depth lost at edges, is missing from the heightmap",
    ),
    Adaptation(
        "all",
        "240 physics steps a second instead of 480; thinner contacts; a friction anchor at the fingertips",
        "time; fingers hold by friction where the original's suction cup is welded to what it touches",
        "harder: things slip and tilt in the jaws, and a grasp can fail",
    ),
    Adaptation(
        "all",
        "a motion that fails costs a step, and the episode goes on",
        "a robot at work goes on; in the original a motion that takes too long ends the episode",
        "easier where steps are left over",
    ),
    Adaptation(
        "all",
        "a scene in which something finds no room is drawn again from the same random numbers",
        "the original leaves out a distractor that finds no room",
        "none on the metric; crowded scenes are rarer",
    ),
    Adaptation(
        "all",
        "where a task was done, the last observation of a demonstration is kept under the sentence said last; "
        "completion sentences of some demo-conditioned tasks are the project's own",
        "the done head learns from it; the original keeps it as a goal image, under the completion sentence",
        "none: an episode has ended when they are said",
    ),
    Adaptation(
        "all",
        "a sentence that the agent refuses ends the episode; in the graph so do done, not there and not sure",
        "a robot at work must know when to stop",
        "none in evaluate without a refusal; in the graph an agent that stops too early keeps the score that stands",
    ),
    Adaptation(
        "all",
        "things have 2 s to come to rest, then the scene is judged and observed as it is",
        "a rope or something round never quite rests",
        "none where all rests by then",
    ),
    Adaptation(
        "all",
        "a held thing is let go at a planned height, just above what the camera saw at the place",
        "the arm goes where the plan says; it does not feel contact",
        "harder: things fall some millimetres, and tilt or bounce where the cloud errs",
    ),
    Adaptation(
        "all",
        "inertias are those of the collision shapes, not three times them",
        "what weighs 100 g shall turn as what weighs 100 g does",
        "not measured; things that are pushed or fall turn sooner",
    ),
    Adaptation(
        "all",
        "a thing whose move changed nothing comes later in the expert's order; one that no camera sees is moved too",
        "physics repeats itself: the same grasp would fail again and again; the expert knows where things are",
        "none on the metric; experts finish scenes that would be given up",
    ),
    Adaptation(
        "put-blocks-in-bowls, place-red-in-green",
        "a bowl's pose is its middle; it collides as 15 wall pieces and a floor",
        "the original mesh lies 26 mm off its pose; fingers and blocks go into bowls",
        "the 5 cm disc is centred on the bowl",
    ),
    Adaptation(
        "put-blocks-in-bowls, place-red-in-green, stack-block-pyramid-seq, stack-block-pyramid",
        "a block weighs 30 g instead of 10 g",
        "steadier grasps",
        "not measured; a block that is touched moves less",
    ),
    Adaptation(
        "put-blocks-in-bowls",
        "a sentence may name the goal; blocks are placed without a turn, where the original turns them as the bowl",
        "chosen goals for demonstrations; the wrist need not turn",
        "none on the metric, which knows no yaw; the place's turn is always 0: without entropy, easier to learn",
    ),
    Adaptation(
        "put-blocks-in-bowls, place-red-in-green",
        "the expert uses no bowl that holds a block of another colour",
        "a block that is set onto another rolls off",
        "none on the metric; a bowl into which such a block has come is not shown as a place",
    ),
    Adaptation(
        "towers-of-hanoi-seq, towers-of-hanoi",
        "rings 50, 60 and 70 mm across and 20 mm thick (not 60, 70, 80 and 10); pegs 45 mm tall (not 50); no turn, "
        "where the original's first move of a ring undoes the stand's yaw",
        "the hand opens 80 mm; its fingers hold one ring and not the one below; its palm clears the peg of a lone ring",
        "none on the metric: x and y within 1 cm; three rings stand above the peg, threaded on it by 5 mm; the place's "
        "turn is always 0: without entropy, easier to learn",
    ),
    Adaptation(
        "block-insertion",
        "the fixture's walls are 20 mm tall, not 40",
        "the fingers, thicker than the clearance of 10 mm, pass over them beside the block",
        "none: pose within 1 cm and 15 degrees",
    ),
    Adaptation(
        "align-box-corner",
        "a box is drawn again until one side is at most 72 mm: 61 % of the original's boxes do not occur",
        "the hand opens 80 mm, and a solid box has neither handle nor rim",
        "easier: narrow boxes only; one whose sides are both above 72 mm is never asked for",
    ),
    Adaptation(
        "palletizing-boxes",
        "25 mm between the boxes' long sides, not 10; boxes appear lying on the table; both places at x = 0.45 m",
        "the fingers open beside a box, whose ends are too far apart for them; the workspace is smaller",
        "none on the metric: the zone is the pallet",
    ),
    Adaptation(
        "palletizing-boxes",
        "the goal is the boxes that have come so far and grows with them; the places of a layer are filled in random "
        "order, not in the reverse of a random unstacking",
        "a box that has not come cannot be scored; a whole layer stands before the next one begins",
        "none on the score of a finished pallet; other orders are shown than the original's expert shows",
    ),
    Adaptation(
        "palletizing-boxes",
        "after the last box has come the episode goes on until all are on the pallet or 30 steps are spent",
        "a grasp may fail; in the original the next action is the last one",
        "easier: a last box that was missed may be tried again",
    ),
    Adaptation(
        "assembling-kits-seq, assembling-kits, packing-unseen-shapes",
        "shapes have outlines of the project's own and collide with their holes and notches, not as convex hulls",
        "no meshes are copied; jaws meet the faces that are seen",
        "none: extents and periods are the original's; the triangle's 120 degrees count, the expert avoids them",
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
        "the hand opens 80 mm and needs something to hold; the original's attitude is a slip",
        "none: points fill the box around whatever it is; none of the project's own is made smaller, 17 % of Google's",
    ),
    Adaptation(
        "packing-google-objects",
        "the expert puts an object beside what lies in the container, a little turned if need be, not onto its middle",
        "what a hand lets go on top of others slides to the walls and leans over them",
        "none: the zone is the container",
    ),
    Adaptation(
        "packing-google-objects",
        "groups: a scene without two of the wanted name and a third object is drawn again",
        "the original asks for whatever of the name found room",
        "harder: there are always two or more to pack",
    ),
    Adaptation(
        "separating-piles, sweeping-piles",
        "the closed fingers, 32 x 18 mm, instead of a spatula of 50 x 5 mm",
        "the hand has no spatula",
        "a little harder: the original's expert needs 11 pushes with the fingers, 9 with the blade (5 scenes, no arm)",
    ),
    Adaptation(
        "separating-piles, sweeping-piles",
        "a sweep goes from the pick to the place exactly; the original's starts 20 mm behind the pick and ends 50 mm "
        "short of the place",
        "an action says where the hand goes",
        "none on the metric; a policy learns other starts and ends: behind the blocks, and short of the zone's middle",
    ),
    Adaptation(
        "separating-piles, sweeping-piles",
        "the expert looks ahead through straight sweeps to 30 mm short of the zone's middle, or to just inside its "
        "edge, for the one that should leave the most inside; the original's pushes the block farthest from the zone "
        "to its middle",
        "chosen for narrow fingers; it saves no sweeps: 11.8 a scene, the original's 10.8 (50 scenes of "
        "separating-piles, no arm, both to the end in all)",
        "none on the metric; demonstrations follow the whole pile, not one block, and are a sweep longer",
    ),
    Adaptation(
        "align-rope, manipulating-rope",
        "the stack from which the rope falls has a random yaw and a wobble of 0.5 mm; it falls 71 mm or more from the "
        "square's sides, and a scene in which a bead comes within 15 mm of the workspace's edge is drawn again",
        "physics repeats itself, and one stack would fall into one heap in all scenes; the hand reaches no farther",
        "none on the metric; heaps differ more than the original's",
    ),
    Adaptation(
        "align-rope, manipulating-rope",
        "the jaws pinch a bead across the rope and turn with it; the expert numbers the slots from the end that fits "
        "the whole rope better, takes the ends first, and prefers a bead beside which the fingers meet no other",
        "a parallel hand has a yaw, and catches what lies beside a bead; the original drags the farthest, unturned; "
        "with its ends in place the rope is nearly straight",
        "none on the metric; other beads and turns are shown than the original's expert shows",
    ),
    Adaptation(
        "align-rope, manipulating-rope",
        "the expert leaves a bead that is within 10 mm of its slot, not 20",
        "the score's edge is 20 mm: a bead on it is dragged off by its neighbours",
        "none on the metric; demonstrations go on where the original's end",
    ),
    Adaptation(
        "align-rope, manipulating-rope",
        "the rope lies across itself in 26 of 30 scenes, not in all: two beads that are no neighbours come within 10 "
        "mm of each other in the plane (python src/sim_bridge/test/test_task_rope.py counts them)",
        "the stack falls with a yaw and a wobble of its own",
        "slightly easier: four of 30 ropes are open from the start",
    ),
)
