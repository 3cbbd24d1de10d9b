"""Every task by its name in the paper; the public implementation's names are aliases.

See docs/benchmark.md, "Names and variants". Other packages add tasks by entry points of the group `sim_bridge.tasks`:
the name is the task's, the object makes it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points

from sim_bridge.errors import SimBridgeError, TaskPackageError, UnknownNameError
from sim_bridge.task_mechanics.task import Split, Task
from sim_bridge.tasks.align_box_corner import AlignBoxCorner
from sim_bridge.tasks.align_rope import AlignRope, ManipulatingRope
from sim_bridge.tasks.assembling_kits import AssemblingKits
from sim_bridge.tasks.assembling_kits_seq import AssemblingKitsSeq
from sim_bridge.tasks.block_insertion import BlockInsertion
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

GROUP = "sim_bridge.tasks"  # of the entry points that add tasks

_COLORS = {"seen-colors": Variant.SEEN, "unseen-colors": Variant.UNSEEN, "full": Variant.FULL}
_GOOGLE = {"seen": Variant.SEEN, "unseen": Variant.UNSEEN}


def _variants(
    template: str, variants: dict[str, Variant], make: Callable[[str, Split, Variant], Task]
) -> dict[str, TaskMaker]:
    """Return a task's variants by their full names: the template with each variant's word in it."""

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
    """Return the split of that name.

    Raises:
        UnknownNameError: naming the nearest ones.
    """
    try:
        return Split(name)
    except ValueError:
        raise UnknownNameError("split", name, [s.value for s in Split]) from None


def make_task(name: str, split: str, instruction: str = "") -> Task:
    """Return a task by name or alias, not yet set up; with an instruction, for the goal that it names.

    Raises:
        UnknownNameError: on an unknown task or split, naming the nearest ones.
        TaskPackageError: when the package that adds the task does not give one.
        GoalError: when the instruction names no goal that the task can set up.
    """
    full_name = ALIASES.get(name, name)
    if full_name in TASKS:
        task = TASKS[full_name](full_name, split_of(split))
    elif full_name in added_tasks():
        task = _made_by(added_tasks()[full_name], split_of(split))
    else:
        raise UnknownNameError("task", name, [*TASKS, *added_tasks(), *ALIASES])
    if instruction.strip():
        task.ask_for(instruction)
    return task


@cache
def added_tasks() -> Mapping[str, EntryPoint]:
    """Return the tasks that installed packages add to the benchmark's, by name.

    Raises:
        TaskPackageError: when two packages add one name, or one that the benchmark has.
    """
    added: dict[str, EntryPoint] = {}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: (entry.name, entry.value)):
        known = added.get(entry.name)
        if entry.name in TASKS or entry.name in ALIASES:
            raise TaskPackageError(entry.name, f"{entry.value} has the name of a task of the benchmark; rename it")
        if known is not None and known.value != entry.value:
            raise TaskPackageError(entry.name, f"{known.value} and {entry.value} have this name; rename one")
        added[entry.name] = entry
    return added


def is_known(name: str) -> bool:
    """Return True if there is a task of that full name."""
    return name in TASKS or name in added_tasks()


def _made_by(entry: EntryPoint, split: Split) -> Task:
    """Load another package's task and make it."""
    try:
        task = entry.load()(entry.name, split)
    except SimBridgeError:
        raise
    except Exception as error:  # what a foreign module does is its own
        raise TaskPackageError(entry.name, f"{entry.value} fails ({type(error).__name__}: {error})") from error
    if not isinstance(task, Task):
        raise TaskPackageError(entry.name, f"{entry.value} made a {type(task).__name__} instead of a Task")
    return task
