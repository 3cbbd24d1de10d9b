"""Station behind the page: draw a pick and a place, execute, record. It knows neither ROS nor web."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from cliport_core.policy_state import PolicyState, ServerStatus
from cliport_core.pose import PlanarPose
from demo_tool.activity import Activity, StationHooks
from demo_tool.arm_work import ArmWork
from demo_tool.bulletin import Bulletin
from demo_tool.calibrate_now import CalibrateNow
from demo_tool.calibration_process import CalibrationProcess
from demo_tool.camera_watch import CameraWatch
from demo_tool.draft_desk import DraftDesk
from demo_tool.errors import EXPECTED_ERRORS, StationError, UnknownCommandError
from demo_tool.home_watch import HomeWatch
from demo_tool.lesson_process import LessonProcess
from demo_tool.library import Library
from demo_tool.live_view import ColorImage, LiveView
from demo_tool.motion_film import MotionFilm
from demo_tool.page_commands import Answer, Arguments, PageCommands
from demo_tool.page_view import PageView
from demo_tool.picture_feed import Picture, PictureFeed
from demo_tool.ports import Arm, Policy, Programs, Scenes
from demo_tool.recording import Recorder
from demo_tool.scene_change import SceneChange
from demo_tool.station_config import StationConfig
from demo_tool.teach_now import TeachNow
from demo_tool.wording import policy_words
from demo_tool.work import Job, WorkThread
from panda_model.preset_files import DEFAULT_PRESET

T = TypeVar("T")
PICTURES = ("color", "camera", "heightmap", "pick_affordance", "place_affordance")
_JUDGE_PERIOD = 1.0  # between judgements of the draft on a newer picture, and announcements of ages [s]


class Station:
    """A workplace with an arm, a policy and a camera. Every method may be called from any thread.

    Commands that draw, move and stop return at once, those that open and edit wait for the disk: `command` is to be
    called in a thread that may wait. Pictures are decoded in the thread that asks for them.

    run: calls long work in another thread; clock: steady time [s]; scenes: of a simulator, where one may run; programs:
    by default processes that write to `learned` beside data_sets_root, and calibration/camera.yaml.
    """

    def __init__(
        self,
        config: StationConfig,
        arm: Arm,
        policy: Policy,
        data_sets_root: Path,
        run: Callable[[Job], None] | None = None,
        clock: Callable[[], float] = time.monotonic,
        scenes: Scenes | None = None,
        programs: Programs | None = None,
    ) -> None:
        self._clock = clock
        self._bulletin = Bulletin()
        self._watch = CameraWatch(config)
        self._home = HomeWatch(config.home, config.home_tolerance)
        self._feeds = {name: PictureFeed() for name in PICTURES}
        self._desk = DraftDesk(config)
        self._recorder = Recorder(data_sets_root, config.min_free)
        self._library = Library(data_sets_root, self._recorder)
        hooks = StationHooks(
            on_recorded=self._on_recorded,
            on_rest=self._on_rest,
            policy_moves=lambda: self._policy_state == PolicyState.EXECUTING.name.lower(),
            is_home=lambda: self._home.is_home,
            film=MotionFilm(self._feeds["color"]),
        )
        self._work = ArmWork(config, arm, policy, self._recorder, self._bulletin, run or WorkThread(), clock, hooks)
        self._page = PageCommands(
            config,
            self._watch,
            self._desk,
            self._work,
            self._recorder,
            self._library,
            now_ns=lambda: self._now_ns,
            clock=clock,
        )
        self._scene = SceneChange(scenes, self._recorder, self._bulletin, self._on_new_scene)
        programs = programs or Programs(
            LessonProcess(data_sets_root.parent / "learned"),
            CalibrationProcess(Path("calibration/camera.yaml"), DEFAULT_PRESET),
        )
        self._teaching = TeachNow(programs.lessons, policy, self._recorder, self._bulletin)
        self._calibrating = CalibrateNow(programs.calibrations, self._bulletin)
        self._when_idle = {**self._page.when_idle, **self._scene.commands, **self._calibrating.when_idle}
        self._when_saved = self._page.when_saved | self._scene.commands.keys()
        self._page_view = PageView(
            config, self._bulletin, self._watch, self._desk, self._work, self._recorder, self._page, clock
        )
        self._policy_state, self._policy_words = "absent", "no policy server has been seen"
        self._now_ns = 0
        self._judged_at = 0.0
        self._was_fresh = False

    # input from the graph

    def on_camera(self, live: LiveView) -> None:
        """Take a picture of the camera."""
        with self._bulletin.lock:
            self._watch.on_view(live, self._clock())
            self._now_ns = live.received_ns
        self._feeds["color"].put(live.stamp_ns, lambda: live.color)

    def on_picture(self, stamp_ns: int, read: Callable[[], ColorImage]) -> None:
        """Take a picture of a camera whose place need not be known; `read` decodes it, (H, W, 3) RGB."""
        self._feeds["camera"].put(stamp_ns, read)

    def on_camera_fault(self, words: str) -> None:
        """Take the reason why the camera's pictures cannot be used."""
        self._watch.fault = words

    def on_joints(self, positions: Mapping[str, float]) -> None:
        """Take the newest measured positions of all joints by name [rad, m]; none where they are old."""
        with self._bulletin.lock:
            before = self._home.is_home
            self._home.on_joints(positions)
            if self._home.is_home != before:
                self._bulletin.touch()

    def on_heightmap(self, stamp_ns: int, read: Callable[[], ColorImage]) -> None:
        """Take a picture of the scene from above; `read` decodes it, (H, W, 3) RGB."""
        self._feeds["heightmap"].put(stamp_ns, read)

    def on_affordance(self, which: str, stamp_ns: int, read: Callable[[], ColorImage]) -> None:
        """Take an affordance map of "pick" or "place"; `read` decodes it, (H, W, 3) RGB."""
        self._feeds[f"{which}_affordance"].put(stamp_ns, read)

    def on_policy_status(self, status: ServerStatus) -> None:
        """Take a status of the policy server."""
        with self._bulletin.lock:
            self._policy_state = status.state.name.lower()
            self._policy_words = policy_words(status.state, status.message)
            if self._work.proposals.request is not None:
                self._work.proposals.request.on_status(status)
            self._bulletin.touch()

    def on_policy_gone(self) -> None:
        """Take that no policy server runs any more; what it did last no longer holds."""
        with self._bulletin.lock:
            self._policy_state, self._policy_words = "absent", "the policy server is gone"
            self._work.proposals.cancel(self._policy_words)
            self._bulletin.touch()

    def on_policy_pose(self, which: str, pose: PlanarPose, stamp_ns: int) -> None:
        """Take the policy server's pose of "pick" or "place", chosen on the picture of stamp_ns."""
        with self._bulletin.lock:
            if self._work.proposals.request is not None:
                self._work.proposals.request.on_pose(which, pose, stamp_ns)

    def tick(self, now_ns: int) -> None:
        """Take the ROS time [ns], and end waits that have lasted too long; to be called at 20 Hz."""
        with self._bulletin.lock:
            self._now_ns = now_ns
            self._work.tick()
            self._page.check_reach()
            wall = self._clock()
            problem = self._watch.problem(now_ns, wall)
            due = wall - self._judged_at >= _JUDGE_PERIOD
            if due:
                self._judged_at = wall
                if problem is None:
                    self._judge_draft()
            if due or self._was_fresh != (problem is None):
                self._was_fresh = problem is None
                self._bulletin.touch()

    # output to the page, and its commands

    @property
    def changed(self) -> int:
        """Number of changes of `view` so far."""
        return self._bulletin.changed

    def wait_change(self, after: int, timeout: float) -> int:
        """Wait until `changed` differs from `after`, at most `timeout` seconds; return it."""
        return self._bulletin.wait(after, timeout)

    def picture(self, name: str, after: int, timeout: float) -> Picture | None:
        """Return the newest picture of a stream of PICTURES if its sequence number exceeds `after`, else None.

        Waits up to `timeout` seconds for it.

        Raises:
            StationError: when the name is unknown, or the picture cannot be decoded.
        """
        if name not in self._feeds:
            raise UnknownCommandError(name, self._feeds)
        try:
            return self._feeds[name].get(after, timeout)
        except EXPECTED_ERRORS as error:
            raise StationError(str(error)) from None

    def episode_picture(self, name: str, step: int, data_set: str | None = None) -> ColorImage:
        """Return the colour image (H, W, 3) RGB of a recorded step. Raises StationError."""
        return _with_station_errors(lambda: self._library.picture(name, step, data_set))

    def motion_picture(self, name: str, step: int, frame: int, data_set: str | None = None) -> bytes:
        """Return a frame of the video of a recorded step's motion, a JPEG file. Raises StationError."""
        return _with_station_errors(lambda: self._library.motion_picture(name, step, frame, data_set))

    def statistics_picture(self) -> bytes:
        """Return the open data set's statistics as a PNG file. Raises StationError."""
        return _with_station_errors(self._library.statistics_png)

    def command(self, name: str, arguments: Arguments) -> Answer:
        """Execute a command and return its answer, whose `words` say what was done.

        Raises:
            StationError: with one line for a person, when the command is refused; it has no effect then.
        """
        known = {
            **self._page.always,
            **self._when_idle,
            **self._library.commands,
            **self._teaching.commands,
            **self._calibrating.always,
        }
        try:
            if name not in known:
                raise UnknownCommandError(name, known)
            if name in self._when_idle:
                self._work.refuse_when_busy()
                self._calibrating.refuse_when_running()
            if name in self._when_saved:
                self._work.refuse_when_unsaved()
            answer = known[name](arguments)
        except EXPECTED_ERRORS as error:
            line = " ".join(str(error).split())
            self._bulletin.refuse(line)
            raise (error if isinstance(error, StationError) else StationError(line)) from None
        if "words" in answer and answer.get("ok", True):
            self._bulletin.say(str(answer["words"]))
        elif "words" in answer:
            self._bulletin.refuse(str(answer["words"]))
        return answer

    def view(self, holder: str | None) -> dict[str, Any]:
        """Return everything that the page shows, as plain values; holder: holder of the arm, passed through."""
        with self._bulletin.lock:
            values = self._page_view.values(holder, self._now_ns, self._policy_state, self._policy_words)
            return {
                **values,
                "scenes": self._scene.is_offered,
                "lesson": self._teaching.lesson.shown(),
                "calibration": self._calibrating.calibration.shown(),
            }

    def close(self) -> None:
        """Cancel the present goal, and leave the episode unfinished on the disk."""
        self._work.close()
        self._recorder.close()
        self._teaching.close()
        self._calibrating.close()

    def _judge_draft(self) -> None:
        view = self._watch.view
        if view is None or self._work.activity is not Activity.NONE:
            return
        try:
            self._desk.judge(view)
        except EXPECTED_ERRORS as error:
            self.on_camera_fault(str(error))

    def _on_rest(self) -> None:
        self._watch.on_rest(self._now_ns)
        self._home.forget()

    def _on_new_scene(self, instruction: str) -> None:
        self._page.instruction = instruction or self._page.instruction
        self._on_recorded()
        self._on_rest()

    def _on_recorded(self) -> None:
        self._desk.clear()
        self._work.proposals.newest = None
        self._work.plan = None


def _with_station_errors(act: Callable[[], T]) -> T:
    """Return act's result; an expected error becomes a StationError of one line."""
    try:
        return act()
    except EXPECTED_ERRORS as error:
        raise StationError(" ".join(str(error).split())) from None
