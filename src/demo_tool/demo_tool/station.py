"""What the page drives: draw a pick and a place, execute, record. Neither ROS nor web."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from cliport_perception.policy_state import PolicyState
from cliport_perception.pose import PlanarPose
from demo_tool.arm_work import EXPECTED, Activity, ArmWork
from demo_tool.box_target import to_pixels
from demo_tool.bulletin import Bulletin
from demo_tool.camera_watch import BEFORE_REST, CameraWatch
from demo_tool.draft_desk import DraftDesk
from demo_tool.errors import StationError, UnknownCommandError
from demo_tool.library import Library
from demo_tool.live_view import ColorImage, LiveView
from demo_tool.page_commands import Answer, Arguments, PageCommands
from demo_tool.picture_feed import Picture, PictureFeed
from demo_tool.ports import Arm, Policy
from demo_tool.recording import Recorder
from demo_tool.station_config import StationConfig
from demo_tool.wording import phase_words, policy_words
from demo_tool.work import Job, WorkThread

T = TypeVar("T")
PICTURES = ("color", "heightmap", "pick_affordance", "place_affordance")
_REJUDGE = 1.0  # how often the draft is looked at on a newer picture, and ages are told [s]


class Station:
    """One workplace. Every method may be called from any thread.

    Commands that draw, move and stop return at once, those that open and edit as soon as the disk has obeyed: call
    `command` where that does no harm. Pictures are decoded when they are asked for, in the asking thread.

    run: does long work elsewhere; clock: steady [s].
    """

    def __init__(
        self,
        config: StationConfig,
        arm: Arm,
        policy: Policy,
        data_sets_root: Path,
        run: Callable[[Job], None] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.config = config
        self._clock = clock
        self._bulletin = Bulletin()
        self._watch = CameraWatch(config)
        self._feeds = {name: PictureFeed() for name in PICTURES}
        self._desk = DraftDesk(config)
        self._recorder = Recorder(data_sets_root, config.min_free)
        self._library = Library(data_sets_root, self._recorder)
        self._work = ArmWork(
            config,
            arm,
            policy,
            self._recorder,
            self._bulletin,
            run or WorkThread(),
            clock,
            on_recorded=self._on_recorded,
            on_rest=lambda: self._watch.on_rest(self._now_ns),
            policy_moves=lambda: self._policy_state == PolicyState.EXECUTING.name.lower(),
        )
        self._page = PageCommands(
            *(config, self._watch, self._desk, self._work, self._recorder, self._library),
            now_ns=lambda: self._now_ns,
            clock=clock,
        )
        self._policy_state, self._policy_words = "absent", "no policy server has been seen"
        self._now_ns = 0
        self._judged_at = 0.0
        self._was_fresh = False

    # what comes in

    def on_camera(self, live: LiveView) -> None:
        """A picture came."""
        with self._bulletin.lock:
            self._watch.on_view(live, self._clock())
            self._now_ns = live.received_ns
        self._feeds["color"].put(live.stamp_ns, lambda: live.color)

    def on_camera_fault(self, words: str) -> None:
        """Pictures come that cannot be used."""
        self._watch.fault = words

    def on_heightmap(self, stamp_ns: int, read: Callable[[], ColorImage]) -> None:
        """The scene from above came; `read` decodes it, RGB."""
        self._feeds["heightmap"].put(stamp_ns, read)

    def on_affordance(self, which: str, stamp_ns: int, read: Callable[[], ColorImage]) -> None:
        """A picture of what the policy thinks came, of its "pick" or "place"; `read` decodes it, RGB."""
        self._feeds[f"{which}_affordance"].put(stamp_ns, read)

    def on_policy_status(
        self, state: PolicyState, message: str, instruction: str, confidence: float | None = None
    ) -> None:
        """The policy server is in a state; confidence: in what waits for approval, 0 to 1, None where not known."""
        with self._bulletin.lock:
            self._policy_state, self._policy_words = state.name.lower(), policy_words(state, message)
            if self._work.request is not None:
                self._work.request.on_status(state, message, instruction, confidence)
            self._bulletin.touch()

    def on_policy_pose(self, which: str, pose: PlanarPose, stamp_ns: int) -> None:
        """Where the policy server would "pick" or "place", chosen on the picture of stamp_ns."""
        with self._bulletin.lock:
            if self._work.request is not None:
                self._work.request.on_pose(which, pose, stamp_ns)

    def tick(self, now_ns: int) -> None:
        """Call often (20 Hz), with the ROS time [ns]."""
        with self._bulletin.lock:
            self._now_ns = now_ns
            self._work.tick()
            wall = self._clock()
            problem = self._watch.problem(now_ns, wall)
            due = wall - self._judged_at >= _REJUDGE
            if due:
                self._judged_at = wall
                if problem is None:
                    self._look_again()
            if due or self._was_fresh != (problem is None):
                self._was_fresh = problem is None
                self._bulletin.touch()

    # what goes out

    @property
    def changed(self) -> int:
        """Counts up whenever `view` has something new to show."""
        return self._bulletin.changed

    def wait_change(self, after: int, timeout: float) -> int:
        """The counter, once it differs from `after`, or after `timeout` seconds."""
        return self._bulletin.wait(after, timeout)

    def picture(self, name: str, after: int, timeout: float) -> Picture | None:
        """The newest of a stream of PICTURES, if newer than sequence number `after`; waits up to `timeout` s.

        Raises:
            StationError: for an unknown name, or when what came cannot be decoded.
        """
        if name not in self._feeds:
            raise UnknownCommandError(name, self._feeds)
        try:
            return self._feeds[name].get(after, timeout)
        except EXPECTED as error:
            raise StationError(str(error)) from None

    def episode_picture(self, name: str, step: int, data_set: str | None = None) -> ColorImage:
        """The colour image (H, W, 3) RGB of a recorded step. Raises StationError."""
        return _said_in_one_line(lambda: self._library.picture(name, step, data_set))

    def statistics_picture(self) -> bytes:
        """The open data set's statistics as PNG. Raises StationError."""
        return _said_in_one_line(self._library.statistics_png)

    def command(self, name: str, arguments: Arguments) -> Answer:
        """Obey, and answer; `words` says what was done.

        Raises:
            StationError: one line for a person; all is as before.
        """
        page = self._page
        known = {**page.always, **page.when_idle, **self._library.commands}
        try:
            if name not in known:
                raise UnknownCommandError(name, known)
            if name in page.when_idle:
                self._work.refuse_when_busy()
            answer = known[name](arguments)
        except EXPECTED as error:
            line = " ".join(str(error).split())
            self._bulletin.refuse(line)
            raise (error if isinstance(error, StationError) else StationError(line)) from None
        if "words" in answer and answer.get("ok", True):
            self._bulletin.say(str(answer["words"]))
        elif "words" in answer:
            self._bulletin.refuse(str(answer["words"]))
        return answer

    def view(self, holder: str | None) -> dict[str, Any]:
        """Everything that the page shows, as plain values; holder: who holds the arm, passed through."""
        with self._bulletin.lock:
            problem = self._watch.problem(self._now_ns, self._clock())
            state, words = self._state(problem)
            phase, progress = self._work.progress
            return {
                "state": state,
                "words": words,
                "instruction": self._page.instruction,
                "history": list(self._recorder.history),
                "primitive": self._desk.primitive.name.lower(),
                "n_rotations": self.config.workspace.n_rotations,
                "draft": {**self._desk.shown(), "source": self._desk.draft.source.name.lower()},
                "plan": self._work.plan,
                "phase": phase_words(phase) if phase else "",
                "progress": progress,
                "data_set": self._recorder.data_set_name,
                "episode": self._recorder.episode,
                "verdict": self._page.verdict,
                "data_sets": list(self._recorder.data_set_names),
                "policy": {
                    "state": self._policy_state,
                    "words": self._policy_words,
                    "proposal": self._proposal_shown(),
                },
                "camera": self._camera_shown(),
                "holder": holder,
                "last": dict(self._bulletin.last),
            }

    def close(self) -> None:
        """Leave the episode as it is, on the disk; a goal that runs is cancelled."""
        self._work.close()
        self._recorder.close()

    def _look_again(self) -> None:
        view = self._watch.view
        if view is None or self._work.activity is not Activity.NONE:
            return
        try:
            self._desk.judge(view)
        except EXPECTED as error:
            self.on_camera_fault(str(error))

    def _state(self, problem: str | None) -> tuple[str, str]:
        work = self._work
        if work.stopped:
            running = f" (still {work.activity.value})" if work.activity is not Activity.NONE else ""
            return "stopped", f"Stopped{running}: nothing moves until you resume."
        if work.activity is not Activity.NONE:
            return work.activity.value, f"{work.activity.value.capitalize()}: {work.words}."
        if problem is not None and not (self._bulletin.failure and problem == BEFORE_REST):
            return ("waiting_for_camera" if self._watch.view is None else "stale"), _sentence(problem)
        if self._bulletin.failure:
            return "failed", _sentence(self._bulletin.failure)
        return "ready", self._next_thing_to_do()

    def _next_thing_to_do(self) -> str:
        if self._recorder.data_set_name is None:
            return "Ready: open a data set to record in."
        if not self._page.instruction:
            return "Ready: type what the next step is to do."
        for which in ("pick", "place"):
            if getattr(self._desk.draft, which) is None:
                return f"Ready: draw the {which} box."
        return "Ready: execute, or only record."

    def _camera_shown(self) -> dict[str, Any]:
        view = self._watch.view
        age = self._watch.age(self._now_ns)
        return {
            "width": view.camera.width if view is not None else 0,
            "height": view.camera.height if view is not None else 0,
            "age_ms": round(1000 * age) if view is not None else None,
            "fps": round(self._watch.rate(self._clock()), 1),
        }

    def _proposal_shown(self) -> dict[str, Any] | None:
        proposal, view = self._work.proposal, self._watch.view
        if proposal is None or view is None:
            return None
        workspace, z = self.config.workspace, self.config.box.table_z
        ends = (("pick", proposal.pick), ("place", proposal.place))
        shown: dict[str, Any] = {"instruction": proposal.instruction, "confidence": proposal.confidence}
        for which, pose in ends:
            shown[f"{which}_pixel"] = to_pixels(view, np.array([[pose.x, pose.y, z]]))[0]
            shown[f"{which}_rotation"] = workspace.bin_of_yaw(pose.yaw)
        return shown

    def _on_recorded(self) -> None:
        self._desk.clear()
        self._work.proposal = None
        self._work.plan = None


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:] + ("" if words.endswith((".", "?", "!")) else ".")


def _said_in_one_line(act: Callable[[], T]) -> T:
    try:
        return act()
    except EXPECTED as error:
        raise StationError(" ".join(str(error).split())) from None
