"""The draft, and what its boxes mean on the picture: targets, fingers, words."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cliport_episodes.demonstration import PixelBox
from cliport_perception.pose import PlanarPose
from cliport_perception.primitive import Primitive
from demo_tool.box_target import (
    BoxTarget,
    across,
    box_around,
    closing_directions,
    find_target,
    finger_outlines,
    table_point,
    to_pixels,
)
from demo_tool.draft import Draft, End, proposed_draft
from demo_tool.errors import BoxError, NotNowError
from demo_tool.live_view import LiveView
from demo_tool.proposing import Proposal
from demo_tool.station_config import StationConfig

_ENDS = ("pick", "place")
_NOTHING: dict[str, Any] = {"directions": [], "footprint": [], "grasp": None}


@dataclass(frozen=True, eq=False)
class JudgedEnd:
    """An end on one picture: pose where it has one, else the words say why not; shown: for the page."""

    pose: PlanarPose | None
    words: str
    shown: dict[str, Any]


@dataclass(frozen=True)
class Choice:
    """A whole draft, as it would be executed: on the picture of `view`."""

    draft: Draft
    primitive: Primitive
    pick: PlanarPose
    place: PlanarPose
    view: LiveView


class DraftDesk:
    """Keeps the draft and its judgement; safe between threads."""

    def __init__(self, config: StationConfig) -> None:
        self._config = config
        self.draft = Draft()
        self.primitive = Primitive.PICK_PLACE
        self._judged: dict[str, JudgedEnd] = {}  # replaced as a whole, so that `shown` never sees half of it
        self._lock = threading.RLock()

    def draw(self, which: str, box: PixelBox, rotation: int, view: LiveView) -> tuple[bool, str]:
        """Draw an end, "pick" or "place"; whether it has a target on the picture, and words."""
        with self._lock:
            self.draft = self.draft.with_end(which, box, rotation)
            self.judge(view)
            return self._judged[which].pose is not None, self._judged[which].words

    def clear(self) -> None:
        """Forget what is drawn."""
        with self._lock:
            self.draft = Draft()
            self._judged = {}

    def choose_primitive(self, primitive: Primitive, view: LiveView | None) -> None:
        """What the arm shall do with the two ends."""
        self.primitive = primitive
        if view is not None:
            self.judge(view)

    def take(self, proposal: Proposal, view: LiveView) -> None:
        """Begin with the policy's proposal: boxes of its crops' size around its poses (paper, appendix D).

        Raises:
            BoxError: when a pose is not in the picture.
        """
        workspace = self._config.workspace
        ends = []
        for which, pose in (("pick", proposal.pick), ("place", proposal.place)):
            box = box_around(view, pose, self._config.crop * workspace.pixel_size, self._config.box.table_z)
            if box is None:
                raise BoxError(f"the policy's {which} ({pose.x:.3f}, {pose.y:.3f}) m is not in the picture")
            ends.append(End(box, workspace.bin_of_yaw(pose.yaw), (pose.x, pose.y)))
        with self._lock:
            self.draft = proposed_draft(*ends)
            self.judge(view)

    def judge(self, view: LiveView) -> None:
        """Look again, on a newer picture. A sweep's hand stands across its way, as the arm will have it."""
        with self._lock:
            ends: dict[str, End] = {which: end for which in _ENDS if (end := getattr(self.draft, which)) is not None}
            judged = {which: self._judge(which, end, view) for which, end in ends.items()}
            if (yaw := self._yaw_of_sweep(judged)) is not None:
                judged = {which: self._judge(which, end, view, yaw) for which, end in ends.items()}
            self._judged = judged

    def choice(self, view: LiveView) -> Choice:
        """The draft, judged on `view`.

        Raises:
            NotNowError: when an end is missing; BoxError: when one has no target.
        """
        with self._lock:
            missing = [which for which in _ENDS if getattr(self.draft, which) is None]
            if missing:
                raise NotNowError(f"draw the {' and the '.join(missing)} box first")
            self.judge(view)
            return Choice(self.draft, self.primitive, self._pose("pick"), self._pose("place"), view)

    def _pose(self, which: str) -> PlanarPose:
        judged = self._judged[which]
        if judged.pose is None:
            raise BoxError(judged.words)
        return judged.pose

    def shown(self) -> dict[str, Any]:
        """For the page: pick and place, None where not drawn."""
        judged = self._judged
        return {which: judged[which].shown if which in judged else None for which in _ENDS}

    def _yaw_of_sweep(self, judged: Mapping[str, JudgedEnd]) -> float | None:
        """Where both ends of a sweep have a pose: across its way, whatever was drawn [rad]."""
        match [end.pose for end in judged.values()] if self.primitive is Primitive.SWEEP else []:
            case [PlanarPose() as start, PlanarPose() as stop]:
                return across(start, stop)
        return None

    def _judge(self, which: str, end: End, view: LiveView, yaw: float | None = None) -> JudgedEnd:
        """On one picture; yaw: instead of the one that is drawn [rad]."""
        workspace, config = self._config.workspace, self._config.box
        yaw = workspace.yaw_of_bin(end.rotation) if yaw is None else yaw
        stands = which == "pick" and self.primitive is Primitive.PICK_PLACE
        target, words = None, ""
        shown: dict[str, Any] = {"box": _corners(end.box), "rotation": workspace.bin_of_yaw(yaw), **_NOTHING}
        if end.box.bottom > view.camera.height or end.box.right > view.camera.width:
            words = f"the {which} box is not in the picture any more: draw it again"
            return JudgedEnd(None, words, {**shown, "words": words})
        try:
            target = find_target(view, end.box, yaw, workspace, config, which, stands)
        except BoxError as error:
            words = str(error)
        pose = target.pose(yaw) if target is not None else None
        if end.position is not None and (target is not None or not stands):
            pose = PlanarPose(*end.position, yaw)
        if pose is not None:
            words = self._words(which, end, target, stands)
        centre = target.centroid if target is not None else table_point(view, end.box, config.table_z)
        x, y, z = (pose.x, pose.y, float(centre[2])) if pose is not None else (float(v) for v in centre)
        footprint = finger_outlines(view, pose, z, self.primitive) if pose is not None else []
        directions = closing_directions(view, x, y, z, workspace.n_rotations)
        shown |= {"directions": directions, "footprint": footprint, "words": words}
        if pose is not None and target is not None:
            shown["grasp"] = {**_cloud_shown(view, target), "footprint": footprint, "words": words}
        return JudgedEnd(pose, words, shown)

    def _words(self, which: str, end: End, target: BoxTarget | None, stands: bool) -> str:
        at = "the policy's position" if end.position is not None else f"centroid of {_count(target)} points"
        if target is None or not stands:
            return at
        height = 1000 * (target.top - self._config.box.table_z)
        words = f"{at}; {height:.0f} mm high, {1000 * target.width:.0f} mm wide between the fingers"
        if target.width > self._config.box.widest:
            words += (
                f": more than the {1000 * self._config.box.widest:.0f} mm that they go round, so try another rotation"
            )
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
