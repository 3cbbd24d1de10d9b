"""A station on fakes behind a real web server, for the tests of the page."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from fake_programs import FakeCalibrations, FakeLessons
from station_fakes import BLOCKS, FakeArm, FakePolicy, FakeTable

from cliport_core.pose import PlanarPose
from demo_tool.ports import Programs
from demo_tool.station import Station
from demo_tool.station_config import StationConfig
from demo_tool.web.access import AccessRule
from demo_tool.web.application import make_application
from demo_tool.web.server import TlsFiles, WebServer, bind

DATA_SET = "blocks"
PATIENCE = 60.0  # s; longest wait for anything: only who waits in vain waits so long, a busy machine does not fail


@dataclass
class Workplace:
    """A station that is served; table, arm and policy are its world."""

    station: Station
    table: FakeTable
    arm: FakeArm
    policy: FakePolicy
    lessons: FakeLessons
    calibrations: FakeCalibrations
    root: Path
    rule: AccessRule
    port: int = 0
    tls: TlsFiles | None = None
    dark: threading.Event = field(default_factory=threading.Event)  # set: the camera sends nothing
    _server: WebServer | None = None

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def draw(self, which: str, box: list[int], rotation: int = 0) -> None:
        self.station.command(which, {"box": box, "rotation": rotation})

    def serve(self) -> None:
        """Begin, or begin again on the same port."""
        listener = bind("127.0.0.1", self.port)
        self.port = listener.getsockname()[1]
        self._server = WebServer(make_application(self.station, self.rule), listener, _fail, self.tls)
        self._server.start()

    def leave(self) -> None:
        """End serving, as when the server is killed."""
        if self._server is not None:
            self._server.stop()

    def begin_anew(self, name: str) -> None:
        """Another data set, an empty draft, an arm that obeys at once."""
        self._wait_until(lambda now: now != "recording")  # the step of the test before is still written
        self.arm.begin_anew(pace=0.03)
        self.station.on_joints({})
        self.policy.heard.clear()
        self.table.blocks = list(BLOCKS)
        for command, arguments in (
            ("resume", {}),
            ("open_data_set", {"name": name}),
            ("primitive", {"name": "pick_place"}),
            ("clear", {}),
            ("instruction", {"text": "put the red block on the blue one"}),
        ):
            self.station.command(command, arguments)
        self.wait_for("ready")

    def wait_for(self, state: str, timeout: float = PATIENCE) -> None:
        """Wait until the station is in a state."""
        self._wait_until(lambda now: now == state, timeout)

    def _wait_until(self, holds: Callable[[str], bool], timeout: float = PATIENCE) -> None:
        end = time.monotonic() + timeout
        while not holds(self.station.view(None)["state"]):
            assert time.monotonic() < end, self.station.view(None)["words"]
            time.sleep(0.01)


@contextmanager
def workplace(
    root: Path, token: str | None = None, host: str = "127.0.0.1", pace: float = 0.0, tls: TlsFiles | None = None
) -> Iterator[Workplace]:
    """A workplace with a camera at 10 Hz, an open data set and an instruction."""
    table = FakeTable()
    arm = FakeArm(pace, on_success=lambda goal: table.move(goal.action.pick, goal.action.place))
    policy = FakePolicy(PlanarPose(0.5, 0.12, 0.5), PlanarPose(0.38, 0.02, 1.0))
    lessons, calibrations = FakeLessons(), FakeCalibrations()
    station = Station(StationConfig(), arm, policy, root, programs=Programs(lessons, calibrations))
    policy.on_status, policy.on_pose = station.on_policy_status, station.on_policy_pose
    rule = AccessRule.for_address(host, token)
    place = Workplace(station, table, arm, policy, lessons, calibrations, root, rule, tls=tls)
    ended = threading.Event()
    camera = threading.Thread(target=_film, args=(place, ended), daemon=True)
    camera.start()
    place.wait_for("ready")
    station.command("open_data_set", {"name": DATA_SET})
    station.command("instruction", {"text": "put the red block on the blue one"})
    place.serve()
    try:
        yield place
    finally:
        ended.set()
        camera.join()
        place.leave()


def _fail(error: BaseException) -> None:
    raise error


def _film(place: Workplace, ended: threading.Event) -> None:
    seen, view = None, None
    while not ended.wait(0.1):
        now = time.time_ns()
        place.station.tick(now)
        if place.dark.is_set():
            continue
        if view is None or seen != list(place.table.blocks):
            seen, view = list(place.table.blocks), place.table.live_view(now)
        place.station.on_picture(now, lambda color=view.color: color)  # type: ignore[misc]
        place.station.on_camera(replace(view, stamp_ns=now, received_ns=now))
