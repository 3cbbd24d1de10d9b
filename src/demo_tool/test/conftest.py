"""A station over a table with coloured blocks, whose arm, policy and clock do what a test says."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from browser_user import chromium
from fake_programs import FakeCalibrations, FakeLessons
from made_anew import MadeAnew
from station_fakes import BLOCKS, Block, FakeArm, FakePolicy, FakeScenes, FakeTable
from web_workplace import Workplace, workplace
from workplace_user import Person

from cliport_core.action import ActionGoal
from cliport_core.pose import PlanarPose
from cliport_episodes.data_set import DataSet
from cliport_episodes.reader import Episode
from demo_tool.errors import StationError
from demo_tool.ports import OnEnd, OnPhase, Programs
from demo_tool.station import Station
from demo_tool.station_config import StationConfig
from demo_tool.web import arm_holder

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# the logic is tested without any build; these need the built messages
_ROS_TESTS = ["test_ros_arm.py", "test_ros_camera.py", "test_ros_link.py", "test_ros_requests.py"]
collect_ignore = [] if find_spec("cliport_interfaces") else _ROS_TESTS

NS = 1_000_000_000


class HeldArm(FakeArm):
    """Answers a goal only when a test does."""

    def send(self, goal: ActionGoal, on_phase: OnPhase, on_end: OnEnd) -> None:
        self.goals.append(goal)
        self.on_phase, self.on_end = on_phase, on_end


class Bench:
    """The station and what surrounds it; time stands still unless it is told to pass."""

    def __init__(self, root: Path, arm: FakeArm | None = None, config: StationConfig | None = None) -> None:
        self.root, self.now = root, 100.0
        self.arm = arm or FakeArm()
        self.table = FakeTable(blocks=list(BLOCKS))
        self.policy = FakePolicy(PlanarPose(0.42, -0.12, 0.0), PlanarPose(0.50, -0.28, 0.0))
        self.scenes, self.lessons, self.calibrations = FakeScenes(), FakeLessons(), FakeCalibrations()
        self.run: Callable[[Callable[[], None]], None] = lambda job: job()
        self.station = Station(
            *(config or StationConfig(), self.arm, self.policy, root),
            run=lambda job: self.run(job),
            clock=lambda: self.now,
            scenes=self.scenes,
            programs=Programs(self.lessons, self.calibrations),
        )
        self.policy.on_status = self.station.on_policy_status
        self.policy.on_pose = self.station.on_policy_pose

    @property
    def now_ns(self) -> int:
        return int(self.now * NS)

    def see(self, age: float = 0.0) -> None:
        """The camera sends a picture."""
        view = self.table.live_view(self.now_ns - int(age * NS), self.now_ns)
        self.station.on_camera(view)
        self.station.tick(self.now_ns)

    def rest(self) -> None:
        """A picture comes that was taken after the arm moved."""
        self.now += 0.2
        self.see()

    def wait(self, seconds: float) -> None:
        """Time passes, without pictures."""
        self.now += seconds
        self.station.tick(self.now_ns)

    def do(self, command: str, /, **arguments: Any) -> dict[str, Any]:
        return self.station.command(command, arguments)

    def refused(self, command: str, /, **arguments: Any) -> str:
        """The one line with which a command is refused; nothing may have moved."""
        before = len(self.arm.goals)
        with pytest.raises(StationError) as caught:
            self.station.command(command, arguments)
        line = str(caught.value)
        assert line and "\n" not in line and self.view["last"] == {"ok": False, "words": line}
        assert len(self.arm.goals) == before, "something moved"
        return line

    def draw(self, block: Block = BLOCKS[0], to: tuple[float, float] = (0.5, -0.28), rotation: int = 0) -> None:
        self.rest()
        self.do("pick", box=self.table.box_around(block), rotation=rotation)
        self.do("place", box=self.table.box_at(*to), rotation=rotation)

    def begin(self, data_set: str = "blocks", instruction: str = "put the red block aside") -> None:
        """Do what a person does before the first step."""
        self.see()
        self.do("open_data_set", name=data_set)
        self.do("instruction", text=instruction)

    def episode(self, number: int = -1) -> Episode:
        """Read an episode of the data set `blocks` from the disk."""
        data_set = DataSet.open(self.root / "blocks")
        return data_set.episode(data_set.episodes()[number].name)

    @property
    def view(self) -> dict[str, Any]:
        return self.station.view(None)

    @property
    def state(self) -> str:
        return str(self.view["state"])

    @property
    def last(self) -> str:
        return str(self.view["last"]["words"])

    @property
    def steps(self) -> list[dict[str, Any]]:
        return self.view["episode"]["steps"] if self.view["episode"] else []


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


@pytest.fixture
def held(tmp_path: Path) -> Bench:
    """A bench with an arm that answers only when the test does."""
    return Bench(tmp_path, HeldArm())


@pytest.fixture
def make_bench(tmp_path: Path) -> Callable[..., Bench]:
    """`make_bench(arm, config, root)`: another bench, on the same folder of data sets if none is named."""
    return lambda arm=None, config=None, root=tmp_path: Bench(root, arm, config)


# the page in a real browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    playwright = pytest.importorskip("playwright.sync_api", reason="no Chromium's driver (playwright) on this machine")
    with playwright.sync_playwright() as driver, chromium(driver) as started:
        yield started


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MadeAnew[Workplace]]:
    with MadeAnew(lambda: workplace(tmp_path_factory.mktemp("sets"), pace=0.03)) as made:
        yield made


@pytest.fixture
def place(served: MadeAnew[Workplace], request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Workplace:
    """A workplace with a data set of the test's own."""
    monkeypatch.setattr(arm_holder, "GONE_AFTER_S", 0.0)  # the page of the test before is gone
    made = served.of(request)
    made.begin_anew(re.sub(r"\W", "-", request.node.name))
    return made


@pytest.fixture
def person(browser: Browser, place: Workplace) -> Iterator[Person]:
    somebody = Person(browser, place)
    yield somebody
    somebody.leave()
