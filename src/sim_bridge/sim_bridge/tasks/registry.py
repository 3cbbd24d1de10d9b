"""Every task by its name in the paper; the public implementation's names are aliases (specification, 0.1 and 8)."""

from __future__ import annotations

from collections.abc import Callable

from sim_bridge.errors import GoalError, UnknownNameError
from sim_bridge.task_mechanics.base import Split, Task
from sim_bridge.tasks.align_box_corner import AlignBoxCorner
from sim_bridge.tasks.align_rope import AlignRope, ManipulatingRope
from sim_bridge.tasks.assembling_kits import AssemblingKits
from sim_bridge.tasks.assembling_kits_seq import AssemblingKitsSeq
from sim_bridge.tasks.block_insertion import BlockInsertion
from sim_bridge.tasks.color_goal import ColorGoal
from sim_bridge.tasks.goal_words import goal_colors
from sim_bridge.tasks.packing_box_pairs import PackingBoxPairs
from sim_bridge.tasks.packing_boxes import PackingBoxes
from sim_bridge.tasks.packing_google_objects import PackingGoogleObjectsGroup, PackingGoogleObjectsSeq
from sim_bridge.tasks.packing_shapes import PackingShapes
from sim_bridge.tasks.palletizing_boxes import PalletizingBoxes
from sim_bridge.tasks.place_red_in_green import PlaceRedInGreen
from sim_bridge.tasks.put_blocks_in_bowls import PutBlocksInBowls
from sim_bridge.tasks.separating_piles import SeparatingPiles, SweepingPiles
from sim_bridge.tasks.stack_block_pyramid import StackBlockPyramid, StackBlockPyramidSeq
from sim_bridge.tasks.towers_of_hanoi import TowersOfHanoi, TowersOfHanoiSeq
from sim_bridge.tasks.variants import Variant

TaskMaker = Callable[[str, Split], Task]

_COLORS = {"seen-colors": Variant.SEEN, "unseen-colors": Variant.UNSEEN, "full": Variant.FULL}
_GOOGLE = {"seen": Variant.SEEN, "unseen": Variant.UNSEEN}


def _variants(
    template: str, variants: dict[str, Variant], make: Callable[[str, Split, Variant], Task]
) -> dict[str, TaskMaker]:
    """A task's variants by their full names: the template with each variant's word in it."""

    def maker(variant: Variant) -> TaskMaker:
        return lambda full_name, split: make(full_name, split, variant)

    return {template.format(word): maker(variant) for word, variant in variants.items()}


TASKS: dict[str, TaskMaker] = {
    "align-rope": AlignRope,
    "packing-unseen-shapes": PackingShapes,
    **_variants("assembling-kits-seq-{}", _COLORS, AssemblingKitsSeq),
    "assembling-kits": AssemblingKits,
    **_variants("put-blocks-in-bowls-{}", _COLORS, PutBlocksInBowls),
    **_variants("packing-box-pairs-{}", _COLORS, PackingBoxPairs),
    "packing-boxes": PackingBoxes,
    **_variants("packing-{}-google-objects-seq", _GOOGLE, PackingGoogleObjectsSeq),
    **_variants("packing-{}-google-objects-group", _GOOGLE, PackingGoogleObjectsGroup),
    **_variants("stack-block-pyramid-seq-{}", _COLORS, StackBlockPyramidSeq),
    **_variants("separating-piles-{}", _COLORS, SeparatingPiles),
    **_variants("towers-of-hanoi-seq-{}", _COLORS, TowersOfHanoiSeq),
    "block-insertion": BlockInsertion,
    "place-red-in-green": PlaceRedInGreen,
    "towers-of-hanoi": TowersOfHanoi,
    "align-box-corner": AlignBoxCorner,
    "stack-block-pyramid": StackBlockPyramid,
    "palletizing-boxes": PalletizingBoxes,
    "manipulating-rope": ManipulatingRope,
    "sweeping-piles": SweepingPiles,
}

# the 18 splits of the paper's tables, in their order
LANGUAGE_SPLITS: tuple[str, ...] = (
    "align-rope",
    "packing-unseen-shapes",
    "assembling-kits-seq-seen-colors",
    "assembling-kits-seq-unseen-colors",
    "put-blocks-in-bowls-seen-colors",
    "put-blocks-in-bowls-unseen-colors",
    "packing-box-pairs-seen-colors",
    "packing-box-pairs-unseen-colors",
    "packing-seen-google-objects-seq",
    "packing-unseen-google-objects-seq",
    "packing-seen-google-objects-group",
    "packing-unseen-google-objects-group",
    "stack-block-pyramid-seq-seen-colors",
    "stack-block-pyramid-seq-unseen-colors",
    "separating-piles-seen-colors",
    "separating-piles-unseen-colors",
    "towers-of-hanoi-seq-seen-colors",
    "towers-of-hanoi-seq-unseen-colors",
)
DEMO_TASKS: tuple[str, ...] = (
    "block-insertion",
    "place-red-in-green",
    "towers-of-hanoi",
    "align-box-corner",
    "stack-block-pyramid",
    "palletizing-boxes",
    "assembling-kits",
    "packing-boxes",
    "manipulating-rope",
    "sweeping-piles",
)

ALIASES: dict[str, str] = {
    "packing-shapes": "packing-unseen-shapes",
    **{f"put-block-in-bowl-{s}": f"put-blocks-in-bowls-{s}" for s in _COLORS},
    **{f"packing-boxes-pairs-{s}": f"packing-box-pairs-{s}" for s in _COLORS},
}


def split_of(name: str) -> Split:
    """The split of that name.

    Raises:
        UnknownNameError: naming the nearest ones.
    """
    try:
        return Split(name)
    except ValueError:
        raise UnknownNameError("split", name, [s.value for s in Split]) from None


def make_task(name: str, split: str, instruction: str = "") -> Task:
    """A task by name or alias, not yet set up; with an instruction, for the goal that it names.

    Raises:
        UnknownNameError: on an unknown task or split, naming the nearest ones.
        GoalError: when the instruction names no goal that the task can set up.
    """
    full_name = ALIASES.get(name, name)
    if full_name not in TASKS:
        raise UnknownNameError("task", name, [*TASKS, *ALIASES])
    if not instruction.strip():
        return TASKS[full_name](full_name, split_of(split))
    return _bowls_for(full_name, split_of(split), goal_colors(instruction))


def _bowls_for(name: str, split: Split, goal: ColorGoal) -> Task:
    family, _, variant = name.partition("bowls-")
    if family != "put-blocks-in-":
        raise GoalError(f"{name} makes no scene for a chosen sentence; leave the instruction empty")
    return PutBlocksInBowls(name, split, _COLORS[variant], goal)
