"""Steps in a bag that is no episode of this project: the picture, the sentence and the two poses, topic by topic."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from cliport_episodes.bags import decode, read_messages
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.demonstration_messages import INSTRUCTION_TOPIC, PICK_TOPIC, PLACE_TOPIC, planar_from_message
from cliport_episodes.message_types import stamp_of
from cliport_episodes.observation import (
    CAMERA_TOPIC,
    COLOR_TOPIC,
    DEPTH_TOPIC,
    TRANSFORM_TOPICS,
    camera_from_info,
    observation_from_messages,
    put_transforms,
)
from cliport_episodes.raw import RawMessage
from cliport_perception.errors import PerceptionError
from cliport_perception.raw_header import header_of_raw
from cliport_perception.transforms import TransformTree
from cliport_perception.workspace import WorkspaceSpec
from cliport_policy.comparison import RecordedStep, Span
from cliport_policy.errors import DataError

_KEPT_PICTURES = 32  # a pose comes this many pictures at most after the one that it was chosen on
_IMAGES = (COLOR_TOPIC, DEPTH_TOPIC)
_POSES = (PICK_TOPIC, PLACE_TOPIC)


def plain_steps(
    path: Path,
    workspace: WorkspaceSpec,
    span: Span,
    complain: Callable[[str], None],
    renamed: Mapping[str, str] | None = None,
) -> Iterator[RecordedStep]:
    """A step for each pick pose with its place pose; span is told when messages were received.

    The picture is the one that has the poses' stamp, or the last before them; the camera does not move. renamed: the
    topics that the bag has instead of this project's, by these. Raises DataError, naming the topic, where something
    that a step needs is not in the bag, and BagError where it can't be read.
    """
    ours = {theirs: mine for mine, theirs in (renamed or {}).items()}
    scene, poses, count = _Scene(path, workspace), dict[str, Any](), 0
    for received in read_messages(path, None, complain):
        span.add(received.stamp_ns)
        raw = replace(received, topic=ours.get(received.topic, received.topic))
        try:
            scene.hear(raw)
            if raw.topic in _POSES:
                poses[raw.topic] = decode(raw)
            step = scene.step(count, poses[PICK_TOPIC], poses[PLACE_TOPIC]) if len(poses) == len(_POSES) else None
        except (PerceptionError, ValueError, AttributeError) as error:
            raise DataError(f"{path}: {raw.topic} of type {raw.type} can't be used ({error})") from None
        if step is not None:
            yield step
            poses, count = {}, count + 1
    if not count:
        raise DataError(f"{path} has no pick with its place ({PICK_TOPIC}, {PLACE_TOPIC}): there is nothing to compare")


class _Scene:
    """What was seen and said up to now."""

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
        elif raw.topic == CAMERA_TOPIC:
            self._info = raw
        elif raw.topic == INSTRUCTION_TOPIC:
            self._said = str(decode(raw).data).strip() or self._said
        elif raw.topic in TRANSFORM_TOPICS:
            put_transforms(self._tree, decode(raw))

    def step(self, number: int, pick: Any, place: Any) -> RecordedStep:
        """What the poses were chosen on. Raises DataError where that is not known."""
        if self._info is None:
            raise DataError(f"{self._path} has no camera_info ({CAMERA_TOPIC}) before its poses: record that topic too")
        if not self._said:
            raise DataError(f"{self._path} has no instruction ({INSTRUCTION_TOPIC}) before its poses: record it too")
        images = [self._picture(topic, stamp_of(pick)) for topic in _IMAGES]
        where = f"{self._path}, {number + 1}. pick"
        setup = self._known_setup(self._info, pick.header.frame_id)
        observation = observation_from_messages([self._info, *images], where, setup)
        heightmap = observation.heightmap(self._workspace)
        poses = (planar_from_message(pick.pose), planar_from_message(place.pose))
        return RecordedStep(self._path.name, number, observation.stamp_ns, heightmap, self._said, *poses)

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
            except PerceptionError as error:
                raise DataError(f"{self._path}: {error}") from None
            self._setup = CaptureSetup(self._workspace, camera, info.header.frame_id, base_frame, camera_in_base)
        return self._setup
