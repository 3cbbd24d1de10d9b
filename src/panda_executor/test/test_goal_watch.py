"""The watch over a goal against clocks that the test sets: each time limit, who is told what, and in which order."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from action_msgs.msg import GoalStatus

from panda_executor import action_call
from panda_executor.action_call import ActionCaller, ActionEnd, cancel_service
from panda_executor.errors import PortError
from panda_executor.ports import MotionStatus

POLL = 1.0 / 64.0  # each sleep and each wait takes so long [s]; floats hold it exactly
NAME = "/arm/follow"


class Ended:
    """A goal's event: set once the time has come, which the test says; waiting lets time pass."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def is_set(self) -> bool:
        return self._bench.has_ended()

    def wait(self, seconds: float) -> bool:
        assert seconds == 0.01, "a stop is looked at a hundred times a second"
        if not self.is_set():
            self._bench.pass_time()
        return self.is_set()


class Bench:
    """A caller whose node, client, clocks and goal are played.

    answers: after so long the server takes the goal (or not, accepts); ends: it ends by itself so long after the goal
    was sent; heeds: which cancels end it at once.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.wall = self.ros = 64.0
        self.rate = 1.0  # of ROS time
        self.answers, self.accepts, self.ends, self.heeds = 0.0, True, 1e9, {"one", "all"}
        self.server_there: Callable[[], bool] = lambda: True
        self.status = GoalStatus.STATUS_SUCCEEDED
        self.log: list[str] = []
        self.sent_at: float | None = None
        self.over = False
        self.lapsed_at = 0.0
        self.asked: list[Any] = []
        monkeypatch.setattr(action_call, "ActionClient", lambda *args, **kwargs: self._note_client(args, kwargs))
        monkeypatch.setattr(action_call, "time", SimpleNamespace(monotonic=lambda: self.wall, sleep=self._sleep))
        monkeypatch.setattr(action_call, "OwnedGoal", lambda client, goal, post: self._send(goal))
        clock = SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=int(self.ros * 1e9)))
        self.node: Any = SimpleNamespace(
            create_client=self._note_service,
            get_clock=lambda: clock,
            executor=None,
        )
        pulse: Any = SimpleNamespace(
            begin=lambda: self.log.append("begin"), beat=lambda: self.log.append("beat"),
            end=lambda: self.log.append("end"), lapse=lambda: self._lapse(),
        )  # fmt: skip
        self.ended = Ended(self)
        self.caller = ActionCaller(self.node, "a type", NAME, "a group", pulse)  # type: ignore[arg-type]

    def _note_service(self, *args: Any, **kwargs: Any) -> SimpleNamespace:
        self.asked.append((args, kwargs))
        return SimpleNamespace(call_async=lambda request: self._cancelled("all"))

    def _note_client(self, args: Any, kwargs: Any) -> SimpleNamespace:
        assert args[1:] == ("a type", NAME) and kwargs == {"callback_group": "a group"}
        return SimpleNamespace(server_is_ready=lambda: self.server_there(), wait_for_server=self._server_comes)

    def _server_comes(self, timeout_sec: float) -> bool:
        self.log.append(f"server within {timeout_sec:g} s")
        return self.server_there()

    def _send(self, goal: Any) -> Bench:
        self.log.append(f"send {goal}")
        self.sent_at = self.wall
        return self

    def _sleep(self, seconds: float) -> None:
        assert seconds == 0.01
        self.pass_time()

    def _lapse(self) -> None:
        if "lapse" not in self.log:
            self.log.append("lapse")
            self.lapsed_at = self.wall

    def pass_time(self) -> None:
        self.wall += POLL
        self.ros += POLL * self.rate

    def stepping(self, at: float, step: float) -> Callable[[], bool]:
        """Return a look for a stop, which never comes, that sets ROS time by `step` once `at` has passed [s]."""

        def look() -> bool:
            if self.sent_at is not None and self.passed == at:
                self.ros += step
            return False

        return look

    def cancel(self) -> None:
        """The goal's cancel."""
        self._cancelled("one")

    def _cancelled(self, which: str) -> None:
        self.log.append(f"cancel {which}")
        self.over = self.over or which in self.heeds

    def has_ended(self) -> bool:
        assert self.sent_at is not None
        return self.over or self.wall - self.sent_at >= self.ends or self.accepted is False

    @property
    def accepted(self) -> bool | None:
        """As the goal's."""
        assert self.sent_at is not None
        return self.accepts if self.wall - self.sent_at >= self.answers else None

    @property
    def answer(self) -> Any:
        """As the goal's: the action's result with its status."""
        return SimpleNamespace(status=self.status, result="the result") if self.has_ended() else None

    def call(self, timeout: float = 1e6, should_stop: Callable[[], bool] = lambda: False) -> ActionEnd:
        return self.caller.call("goal", timeout, should_stop, lambda: self.log.append("accepted"))

    @property
    def passed(self) -> float:
        assert self.sent_at is not None
        return self.wall - self.sent_at

    def told(self) -> list[str]:
        """All that happened but for beats that follow one another."""
        return [words for i, words in enumerate(self.log) if words != "beat" or self.log[i - 1] != "beat"]


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def test_a_goal_that_ends_by_itself(bench: Bench) -> None:
    bench.answers, bench.ends = 0.5, 2.0
    assert bench.call() == ActionEnd(MotionStatus.SUCCEEDED, "the result", "", True)
    assert bench.told() == ["server within 1 s", "begin", "send goal", "beat", "accepted", "beat", "end"]
    assert bench.log.count("beat") == 32 + 95, "each look is told: before the answer, and after it"
    assert bench.asked[0][0][1] == f"{NAME}/_action/cancel_goal" == cancel_service(NAME)
    assert bench.asked[0][1] == {"callback_group": "a group"}
    assert bench.caller.is_ready() is True


@pytest.mark.parametrize(
    ("status", "said"),
    [
        (GoalStatus.STATUS_SUCCEEDED, MotionStatus.SUCCEEDED),
        (GoalStatus.STATUS_CANCELED, MotionStatus.CANCELLED),
        (GoalStatus.STATUS_ABORTED, MotionStatus.ABORTED),
        (GoalStatus.STATUS_UNKNOWN, MotionStatus.ABORTED),
    ],
)
def test_the_servers_word_counts(bench: Bench, status: int, said: MotionStatus) -> None:
    bench.status, bench.ends = status, 1.0
    assert bench.call() == ActionEnd(said, "the result")


def test_nothing_is_sent_without_a_server_or_after_a_stop(bench: Bench) -> None:
    assert bench.call(should_stop=lambda: True) == ActionEnd(
        MotionStatus.CANCELLED, None, "stopped before it was sent", True
    )
    bench.server_there = lambda: False
    assert bench.call() == ActionEnd(MotionStatus.UNAVAILABLE, None, f"no action server at {NAME}", True)
    assert bench.log == ["server within 1 s"] * 2
    assert bench.caller.is_ready() is False


def test_an_answer_is_waited_for_as_long_as_three_seconds(bench: Bench) -> None:
    bench.answers, bench.ends = 3.0, 4.0
    assert bench.call().status is MotionStatus.SUCCEEDED
    bench.answers = 4.0
    bench.ends = 1e9
    end = bench.call()
    assert (end.status, end.message, end.confirmed) == (MotionStatus.UNAVAILABLE, f"no answer from {NAME}", True)
    assert bench.passed == 3.0 + POLL
    assert bench.log[-2:] == ["cancel one", "end"]


def test_a_goal_that_is_not_taken_needs_no_cancel(bench: Bench) -> None:
    bench.accepts = False
    end = bench.call()
    assert (end.status, end.message, end.confirmed) == (MotionStatus.REJECTED, f"{NAME} did not take the goal", True)
    assert bench.told() == ["server within 1 s", "begin", "send goal", "end"]


@pytest.mark.parametrize("answers", [0.0, 9.0])
def test_a_stop_cancels_at_once(bench: Bench, answers: float) -> None:
    bench.answers = answers
    end = bench.call(should_stop=lambda: bench.sent_at is not None and bench.passed >= 0.5)
    assert (end.status, end.message, end.confirmed) == (MotionStatus.CANCELLED, "stopped on request", True)
    assert end.result == "the result"
    assert bench.passed == 0.5
    assert bench.log[-2:] == ["cancel one", "end"]


def test_a_motion_may_take_its_time_and_no_more(bench: Bench) -> None:
    end = bench.call(timeout=2.0)
    assert (end.status, end.message) == (MotionStatus.TIMED_OUT, f"{NAME} took more than 2.0 s")
    assert bench.passed == 2.0 + POLL
    bench.ends = 2.0 + POLL
    assert bench.call(timeout=2.0).status is MotionStatus.SUCCEEDED


def test_the_time_is_that_of_ros(bench: Bench) -> None:
    bench.rate = 0.5
    assert bench.call(timeout=2.0).status is MotionStatus.TIMED_OUT
    assert bench.passed == 4.0 + POLL


def test_a_clock_that_is_corrected_gives_the_time_anew(bench: Bench) -> None:
    end = bench.call(timeout=2.0, should_stop=bench.stepping(1.5, -0.125))
    assert end.status is MotionStatus.TIMED_OUT
    assert bench.passed == 1.5 + 2.0 + POLL


@pytest.mark.parametrize(
    ("step", "words"), [(-10.0, "jumped 10.0 s back"), (-0.5, "jumped 0.5 s back"), (10.0, "jumped 10.0 s ahead")]
)
def test_a_motion_ends_when_the_clock_jumps(bench: Bench, step: float, words: str) -> None:
    with pytest.raises(PortError, match=words):
        bench.call(timeout=20.0, should_stop=bench.stepping(1.5, step))
    assert bench.passed == 1.5
    assert bench.log[-2:] == ["cancel one", "end"]


def test_a_clock_that_stands_still_is_noticed_after_five_seconds(bench: Bench) -> None:
    bench.rate = 0.0
    end = bench.call(timeout=2.0)
    assert (end.status, end.message) == (MotionStatus.TIMED_OUT, "the clock stands still")
    assert bench.passed == 5.0 + POLL


def test_a_clock_that_moves_now_and_then_does_not_stand_still(bench: Bench) -> None:
    bench.rate = 0.0

    def look() -> bool:
        if bench.sent_at is not None and bench.passed in (4.5, 9.0):
            bench.ros += 0.25
        return False

    assert bench.call(timeout=2.0, should_stop=look).message == "the clock stands still"
    assert bench.passed == 14.0 + POLL


def test_a_server_that_went_away_is_noticed_after_a_second(bench: Bench) -> None:
    asked: list[float] = []

    def there() -> bool:
        if bench.sent_at is not None:
            asked.append(bench.passed)
        return len(asked) < 3

    bench.server_there = there
    end = bench.call()
    assert (end.status, end.message) == (MotionStatus.UNAVAILABLE, f"{NAME} went away")
    every = 0.25 + POLL
    assert asked == [every * number for number in range(1, 7)], "it is asked four times a second, no more"
    assert bench.passed == 6 * every, "the first look more than a second after the server was last seen"


def test_a_cancel_that_is_not_heard_is_followed_by_one_of_everything(bench: Bench) -> None:
    bench.heeds = {"all"}
    end = bench.call(should_stop=lambda: bench.sent_at is not None and bench.passed >= 0.5)
    assert end == ActionEnd(MotionStatus.CANCELLED, "the result", "stopped on request", True)
    assert bench.passed == 1.5, "a second is left to the first"
    assert bench.log[-4:] == ["cancel one", "lapse", "cancel all", "end"]


def test_what_nobody_saw_end_leaves_no_sign_of_life(bench: Bench) -> None:
    bench.heeds = set()
    end = bench.call(should_stop=lambda: bench.sent_at is not None and bench.passed >= 0.5)
    words = "stopped on request; the cancel was not confirmed"
    assert end == ActionEnd(MotionStatus.CANCELLED, None, words, False)
    assert bench.passed == 2.5
    assert bench.log[-3:] == ["cancel one", "lapse", "cancel all"], "neither a beat nor an end after them"


def test_whoever_watches_is_told_a_tenth_of_a_second_after_a_cancel_that_is_not_heard(bench: Bench) -> None:
    bench.heeds = set()
    bench.call(should_stop=lambda: bench.sent_at is not None and bench.passed >= 0.5)
    assert bench.sent_at is not None
    assert bench.lapsed_at - bench.sent_at == pytest.approx(0.5 + 0.1, abs=POLL)


def test_an_arm_that_brakes_is_not_blamed_for_it(bench: Bench) -> None:
    bench.heeds, bench.ends = set(), 0.5 + 0.09
    bench.call(should_stop=lambda: bench.sent_at is not None and bench.passed >= 0.5)
    assert "lapse" not in bench.log and bench.log[-1] == "end"


def test_an_error_of_the_watch_cancels_too(bench: Bench) -> None:
    def fail() -> bool:
        if bench.sent_at is not None:
            raise ValueError("lost")
        return False

    with pytest.raises(ValueError, match="lost"):
        bench.call(should_stop=fail)
    assert bench.log[-2:] == ["cancel one", "end"]


def test_what_goes_to_ros_is_called_by_the_thread_that_spins(bench: Bench) -> None:
    tasks: list[Callable[[], object]] = []
    bench.node.executor = SimpleNamespace(create_task=tasks.append)
    bench.caller.cancel_all()
    assert bench.log == [] and len(tasks) == 1
    tasks[0]()
    assert bench.log == ["cancel all"]


def test_a_caller_that_tells_nobody_of_its_looks_works_as_well(bench: Bench) -> None:
    bench.ends = 1.0
    caller = ActionCaller(bench.node, "a type", NAME, "a group")  # type: ignore[arg-type]
    assert caller.call("goal", 9.0, lambda: False).status is MotionStatus.SUCCEEDED
