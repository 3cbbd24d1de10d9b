"""Steps in a bag that is no episode of this project: the picture, the sentence and the two poses, topic by topic."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from cliport_core import topics
from cliport_core.action import PickPlaceAction
from cliport_core.errors import CoreError
from cliport_core.raw_header import header_of_raw
from cliport_core.transforms import TransformTree
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.bags import decode, read_messages
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.demonstration_messages import planar_from_message
from cliport_episodes.message_types import stamp_of
from cliport_episodes.observation import TRANSFORM_TOPICS, camera_from_info, observation_from_messages, put_transforms
from cliport_episodes.raw import RawMessage
from cliport_policy.comparison import RecordedStep, Span
from cliport_policy.errors import DataError

_KEPT_PICTURES = 32  # most pictures between the one that a pose was chosen on and the pose
_IMAGES = (topics.COLOR, topics.DEPTH)
_POSES = (topics.PICK_POSE, topics.PLACE_POSE)


def plain_steps(
    path: Path,
    workspace: WorkspaceSpec,
    span: Span,
    complain: Callable[[str], None],
    renamed: Mapping[str, str] | None = None,
) -> Iterator[RecordedStep]:
    """Yield a step for each pick pose with its place pose; `span` is extended by the messages' times of reception.

    The two poses of a step have one stamp. The picture is the one that has it, or the last before them; the camera does
    not move. complain: told once of poses without a partner, which are left out.

    renamed: the bag's topics, by this project's names for them.

    Raises:
        DataError: naming the topic, if something that a step needs is not in the bag.
        BagError: if the bag can't be read.
    """
    ours = {theirs: mine for mine, theirs in (renamed or {}).items()}
    scene, pairs, poses, count = _Scene(path, workspace), _Pairs(path, complain), dict[str, Any](), 0
    for received in read_messages(path, None, complain):
        span.add(received.stamp_ns)
        raw = replace(received, topic=ours.get(received.topic, received.topic))
        try:
            scene.hear(raw)
            if raw.topic in _POSES:
                poses[raw.topic] = decode(raw)
                pairs.keep_one_stamp(poses)
            step = scene.step(count, *(poses[topic] for topic in _POSES)) if len(poses) == len(_POSES) else None
        except (CoreError, ValueError, AttributeError) as error:
            raise DataError(f"{path}: {raw.topic} of type {raw.type} can't be used ({error})") from None
        if step is not None:
            yield step
            poses, count = {}, count + 1
    if not count:
        raise DataError(
            f"{path} has no pick with its place of the same stamp ({', '.join(_POSES)}): there is nothing to compare"
        )


class _Pairs:
    """The rule by which poses are paired: by their stamps, since a recording may begin between the two."""

    def __init__(self, path: Path, complain: Callable[[str], None]) -> None:
        self._path, self._complain = path, complain
        self._complained = False

    def keep_one_stamp(self, poses: dict[str, Any]) -> None:
        """Take the older of two poses away where their stamps differ."""
        stamps = {topic: stamp_of(pose) for topic, pose in poses.items()}
        if len(set(stamps.values())) < 2:
            return
        del poses[min(stamps, key=lambda topic: stamps[topic])]
        if not self._complained:
            self._complain(f"{self._path} has poses without a partner of the same stamp: they are left out")
            self._complained = True


class _Scene:
    """Pictures and sentence up to the present message."""

    def __init__(self, path: Path, workspace: WorkspaceSpec) -> None:
        self._path, self._workspace = path, workspace
        self._said = ""
        self._setup: CaptureSetup | None = None
        self._tree = TransformTree()
        self._info: RawMessage | None = None
        self._pictures: dict[str, deque[RawMessage]] = {topic: deque(maxlen=_KEPT_PICTURES) for topic in _IMAGES}

    def hear(self, raw: RawMessage) -> None:
        """Take note of a message."""
        if raw.topic in _IMAGES:
            self._pictures[raw.topic].append(raw)
        elif raw.topic == topics.CAMERA_INFO:
            self._info = raw
        elif raw.topic == topics.INSTRUCTION:
            self._said = str(decode(raw).data).strip() or self._said
        elif raw.topic in TRANSFORM_TOPICS:
            put_transforms(self._tree, decode(raw))

    def step(self, number: int, pick: Any, place: Any) -> RecordedStep:
        """Return the step of two poses, with the picture and the sentence that they were chosen on.

        Raises:
            DataError: if no camera, sentence or picture came before.
        """
        if self._info is None:
            raise DataError(
                f"{self._path} has no camera_info ({topics.CAMERA_INFO}) before its poses: record that topic too"
            )
        if not self._said:
            raise DataError(f"{self._path} has no instruction ({topics.INSTRUCTION}) before its poses: record it too")
        images = [self._picture(topic, stamp_of(pick)) for topic in _IMAGES]
        where = f"{self._path}, {number + 1}. pick"
        setup = self._known_setup(self._info, pick.header.frame_id)
        observation = observation_from_messages([self._info, *images], where, setup)
        heightmap = observation.heightmap(self._workspace)
        action = PickPlaceAction(planar_from_message(pick.pose), planar_from_message(place.pose))
        return RecordedStep(
            self._path.name,
            number,
            observation.stamp_ns,
            heightmap,
            self._said,
            action,
        )

    def _picture(self, topic: str, stamp_ns: int) -> RawMessage:
        kept = self._pictures[topic]
        if not kept:
            raise DataError(f"{self._path} has no picture on {topic} before its poses: record that topic too")
        return next((raw for raw in kept if header_of_raw(raw.data)[0] == stamp_ns), kept[-1])

    def _known_setup(self, camera_info: RawMessage, base_frame: str) -> CaptureSetup:
        if self._setup is None:
            info = decode(camera_info)
            try:
                camera = camera_from_info(info)
                camera_in_base = self._tree.source_in_target(info.header.frame_id, base_frame)
            except CoreError as error:
                raise DataError(f"{self._path}: {error}") from None
            self._setup = CaptureSetup(self._workspace, camera, info.header.frame_id, base_frame, camera_in_base)
        return self._setup
