"""The draft and its judgement on the picture: targets, fingers, words."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cliport_core.action import ActionGoal, PickPlaceAction, Primitive
from cliport_core.pose import PlanarPose
from cliport_episodes.demonstration import PixelBox
from demo_tool.box_target import (
    BoxTarget,
    box_around,
    closing_directions,
    find_target,
    finger_outlines,
    sweep_yaw,
    table_point,
    to_pixels,
)
from demo_tool.draft import Draft, End, proposed_draft
from demo_tool.errors import BoxError, NotNowError
from demo_tool.live_view import LiveView
from demo_tool.pointed_object import spot_at, thing_at
from demo_tool.station_config import StationConfig

_ENDS = ("pick", "place")
_NOTHING: dict[str, Any] = {"directions": [], "footprint": [], "grasp": None}


@dataclass(frozen=True, eq=False)
class JudgedEnd:
    """An end on one picture; pose: None where the words say why there is none; shown: values for the page."""

    pose: PlanarPose | None
    words: str
    shown: dict[str, Any]


@dataclass(frozen=True)
class DrawnAction:
    """A whole draft, and the action that it means on the picture of `view`."""

    draft: Draft
    action: PickPlaceAction
    view: LiveView


class DraftDesk:
    """Draft and its judgement; safe between threads."""

    def __init__(self, config: StationConfig) -> None:
        self._config = config
        self.draft = Draft()
        self.primitive = Primitive.PICK_PLACE
        self._judged: dict[str, JudgedEnd] = {}  # replaced as a whole, so that `shown` never sees half of it
        self._lock = threading.RLock()

    def draw(self, which: str, box: PixelBox, rotation: int, view: LiveView) -> tuple[bool, str]:
        """Draw an end, "pick" or "place"; return True and words where it has a target on the picture, else False."""
        with self._lock:
            self.draft = self.draft.with_end(which, box, rotation)
            self.judge(view)
            return self._judged[which].pose is not None, self._judged[which].words

    def point(self, which: str, row: int, col: int, rotation: int, view: LiveView) -> tuple[bool, str]:
        """Draw an end around the thing at a pixel, as `draw` does; without a thing, around the table there.

        rotation: of a place, and of what has no narrow side.

        Raises:
            BoxError: when an object is to be picked and nothing stands there, or the table is not seen there.
        """
        workspace, config = self._config.workspace, self._config.box
        thing = thing_at(view, row, col, config)
        if thing is None and self._needs_object(which):
            raise BoxError("nothing stands there: click on a thing, or draw a box around it")
        if thing is not None and which == "pick":
            rotation = workspace.bin_of_yaw(thing.yaw)
        box = thing.box if thing is not None else spot_at(view, row, col, config.table_z)
        return self.draw(which, box, rotation, view)

    def clear(self) -> None:
        """Forget what is drawn."""
        with self._lock:
            self.draft = Draft()
            self._judged = {}

    def choose_primitive(self, primitive: Primitive, view: LiveView | None) -> None:
        """Choose the primitive that the arm performs with the two ends."""
        self.primitive = primitive
        if view is not None:
            self.judge(view)

    def take(self, proposal: ActionGoal, view: LiveView) -> None:
        """Replace the draft by the policy's proposal.

        The boxes have the size of the policy's crops around its poses (paper, appendix D).

        Raises:
            BoxError: when a pose is not in the picture.
        """
        workspace = self._config.workspace
        ends = []
        for which, pose in (("pick", proposal.action.pick), ("place", proposal.action.place)):
            box = box_around(view, pose, self._config.crop * workspace.pixel_size, self._config.box.table_z)
            if box is None:
                raise BoxError(f"the policy's {which} ({pose.x:.3f}, {pose.y:.3f}) m is not in the picture")
            ends.append(End(box, workspace.bin_of_yaw(pose.yaw), (pose.x, pose.y)))
        with self._lock:
            self.draft, self.primitive = proposed_draft(*ends), proposal.action.primitive
            self.judge(view)

    def judge(self, view: LiveView) -> None:
        """Judge the draft on a newer picture; a sweep's hand is across its way, as the executor turns it."""
        with self._lock:
            ends: dict[str, End] = {}
            for which in _ENDS:
                end = getattr(self.draft, which)
                if end is not None:
                    ends[which] = end
            judged = {which: self._judge(which, end, view) for which, end in ends.items()}
            yaw = self._yaw_of_sweep(judged)
            if yaw is not None:
                judged = {which: self._judge(which, end, view, yaw) for which, end in ends.items()}
            self._judged = judged

    def drawn_action(self, view: LiveView) -> DrawnAction:
        """Judge the draft on `view` and return it with its action.

        Raises:
            NotNowError: when an end is missing; BoxError: when one has no target.
        """
        with self._lock:
            missing = [which for which in _ENDS if getattr(self.draft, which) is None]
            if missing:
                raise NotNowError(f"draw the {' and the '.join(missing)} box first")
            self.judge(view)
            action = PickPlaceAction(self._pose("pick"), self._pose("place"), self.primitive)
            return DrawnAction(self.draft, action, view)

    def matches(self, shown: Any) -> bool:
        """Return True if a page that shows {primitive, pick, place} shows this draft; a sweep's rotations are free.

        Each end is {box, rotation} as in `shown`, or None where nothing is drawn.
        """
        with self._lock:
            if not isinstance(shown, Mapping) or shown.get("primitive") != self.primitive.name.lower():
                return False
            return all(self._end_matches(getattr(self.draft, which), shown.get(which)) for which in _ENDS)

    def _end_matches(self, end: End | None, shown: Any) -> bool:
        match shown:
            case {"box": box, "rotation": rotation} if end is not None:
                turned = rotation == end.rotation or self.primitive is Primitive.SWEEP
                return bool(box == _corners(end.box) and turned)
        return end is None and shown is None

    def _pose(self, which: str) -> PlanarPose:
        judged = self._judged[which]
        if judged.pose is None:
            raise BoxError(judged.words)
        return judged.pose

    def shown(self) -> dict[str, Any]:
        """Return pick and place as the page shows them, None where not drawn."""
        judged = self._judged
        return {which: judged[which].shown if which in judged else None for which in _ENDS}

    def _yaw_of_sweep(self, judged: Mapping[str, JudgedEnd]) -> float | None:
        """Return the yaw of a sweep whose ends both have a pose, whatever was drawn [rad]; else None."""
        if self.primitive is not Primitive.SWEEP or len(judged) < len(_ENDS):
            return None
        start, stop = judged["pick"].pose, judged["place"].pose
        return None if start is None or stop is None else sweep_yaw(start, stop)

    def _needs_object(self, which: str) -> bool:
        return which == "pick" and self.primitive is Primitive.PICK_PLACE

    def _judge(self, which: str, end: End, view: LiveView, yaw: float | None = None) -> JudgedEnd:
        """Judge an end on one picture; yaw: replaces the one that is drawn [rad]."""
        workspace, config = self._config.workspace, self._config.box
        yaw = workspace.yaw_of_bin(end.rotation) if yaw is None else yaw
        needs_object = self._needs_object(which)
        target, words = None, ""
        shown: dict[str, Any] = {"box": _corners(end.box), "rotation": workspace.bin_of_yaw(yaw), **_NOTHING}
        if end.box.bottom > view.camera.height or end.box.right > view.camera.width:
            words = f"the {which} box is not in the picture any more: draw it again"
            return JudgedEnd(None, words, {**shown, "words": words})
        try:
            target = find_target(view, end.box, yaw, workspace, config, which, needs_object)
        except BoxError as error:
            words = str(error)
        pose = target.pose(yaw) if target is not None else None
        if end.position is not None and (target is not None or not needs_object):
            pose = PlanarPose(*end.position, yaw)
        if pose is not None:
            words = self._words(which, end, target, needs_object)
        centre = target.centroid if target is not None else table_point(view, end.box, config.table_z)
        x, y, z = (pose.x, pose.y, float(centre[2])) if pose is not None else (float(v) for v in centre)
        footprint = finger_outlines(view, pose, z, config.hand, self.primitive) if pose is not None else []
        directions = closing_directions(view, x, y, z, workspace.n_rotations)
        shown |= {"directions": directions, "footprint": footprint, "words": words}
        if pose is not None and target is not None:
            shown["grasp"] = {**_cloud_shown(view, target), "footprint": footprint, "words": words}
        return JudgedEnd(pose, words, shown)

    def _words(self, which: str, end: End, target: BoxTarget | None, needs_object: bool) -> str:
        at = "the policy's position" if end.position is not None else f"centroid of {_count(target)} points"
        if target is None or not needs_object:
            return at
        height = 1000 * (target.top - self._config.box.table_z)
        words = f"{at}; {height:.0f} mm high, {1000 * target.width:.0f} mm wide between the fingers"
        widest = self._config.box.hand.widest
        if target.width > widest:
            words += f": more than the {1000 * widest:.0f} mm that they go round, so try another rotation"
        return words


def _count(target: BoxTarget | None) -> int:
    return 0 if target is None else len(target.pixels)


def _corners(box: PixelBox) -> list[int]:
    return [box.top, box.left, box.bottom, box.right]


def _cloud_shown(view: LiveView, target: BoxTarget) -> dict[str, Any]:
    return {
        "centroid_base": [round(float(v), 4) for v in target.centroid],
        "centroid_pixel": to_pixels(view, target.centroid[None])[0],
        "cloud_pixels": target.shown_pixels(),
        "points": len(target.pixels),
    }
