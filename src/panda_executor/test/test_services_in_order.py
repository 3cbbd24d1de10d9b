"""The services for a person, step by step: what each answers, what it begins, and that the gate is left again."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("cliport_interfaces.srv")

from std_srvs.srv import Trigger

from cliport_core.outcome import ActionResult, Outcome
from cliport_interfaces.srv import ApprovePlan
from panda_executor import node_services
from panda_executor.approvals import Approvals
from panda_executor.errors import RequestError
from panda_executor.gate import Gate
from panda_executor.node_services import PersonServices

NAMES = {name: f"/panda_executor/{name}" for name in ("stop", "resume", "approve", "ready", "recover", "open")}
MOTIONS = {"ready": "go_ready", "recover": "recover", "open": "open"}


class Bench:
    """The services over a node, a runner and surroundings that are played; threads run when the test lets them."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.log: list[str] = []
        self.services: dict[str, tuple[Any, Callable[[Any, Any], Any]]] = {}
        self.gate, self.approvals = Gate(), Approvals(9.0)
        self.begun: list[Callable[[], None]] = []
        self.lacks: str | RequestError = ""
        self.failure: Exception | None = None
        self.stops: list[Callable[[], bool]] = []
        monkeypatch.setattr(node_services, "threading", SimpleNamespace(Thread=self._thread))
        logger = SimpleNamespace(**{level: self._writer(level) for level in ("info", "warning", "error")})
        node: Any = SimpleNamespace(create_service=self._serve, get_logger=lambda: logger)
        runner: Any = SimpleNamespace(**{name: self._work(name) for name in MOTIONS.values()})
        around: Any = SimpleNamespace(missing=self._missing, cloud=lambda: "the cloud")
        group: Any = "group"
        PersonServices(node, self.gate, runner, self.approvals, self._stop, around, group)

    def _writer(self, level: str) -> Callable[[str], None]:
        return lambda words: self.log.append(f"{level}: {words}")

    def _serve(self, kind: Any, name: str, callback: Callable[[Any, Any], Any], callback_group: Any) -> None:
        assert callback_group == "group"
        self.services[name] = kind, callback

    def _thread(self, target: Callable[[], None], name: str, daemon: bool) -> SimpleNamespace:
        assert daemon, "it must not keep the process alive"
        return SimpleNamespace(start=lambda: self.begun.append(target))

    def _work(self, name: str) -> Callable[..., ActionResult]:
        def work(should_stop: Callable[[], bool], *cloud: str) -> ActionResult:
            self.log.append(" in ".join((name, *cloud)))
            self.stops.append(should_stop)
            if self.failure is not None:
                raise self.failure
            return ActionResult(Outcome.EXECUTION_FAILED, "its words")

        return work

    def _stop(self) -> None:
        self.log.append(f"stop of a {'stopped' if self.gate.stopped else 'free'} gate")

    def _missing(self) -> str:
        if isinstance(self.lacks, RequestError):
            raise self.lacks
        return self.lacks

    def call(self, name: str, request: Any = None) -> tuple[bool, str]:
        kind, callback = self.services[NAMES[name]]
        response = callback(request or kind.Request(), kind.Response())
        return bool(response.success), str(response.message)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def test_all_are_offered(bench: Bench) -> None:
    assert {name: kind for name, (kind, _) in bench.services.items()} == {
        path: ApprovePlan if name == "approve" else Trigger for name, path in NAMES.items()
    }


def test_a_stop_shuts_the_gate_before_it_cancels_and_a_resume_opens_it(bench: Bench) -> None:
    assert bench.call("stop") == (True, "stopped; goals are rejected until /panda_executor/resume")
    assert bench.log == ["stop of a stopped gate"], "else the next goal would begin between the two"
    assert bench.gate.refusal() == "stopped on request; call /panda_executor/resume first"
    for name in MOTIONS:
        assert bench.call(name) == (False, "stopped on request; call /panda_executor/resume first")
    assert not bench.begun
    assert bench.call("resume") == (True, "goals are accepted")
    assert bench.gate.refusal() is None


def test_an_approval_is_handed_on(bench: Bench) -> None:
    bench.approvals.offer("plan-1")
    assert bench.call("approve", ApprovePlan.Request(plan_id="other")) == (
        False, "the plan that waits is plan-1, not other"
    )  # fmt: skip
    assert bench.call("approve", ApprovePlan.Request(plan_id="plan-1")) == (True, "plan plan-1 is approved")


@pytest.mark.parametrize("name", MOTIONS)
def test_a_motion_answers_at_once_runs_through_the_gate_and_ends_in_the_log(bench: Bench, name: str) -> None:
    assert bench.call(name) == (True, "begun; the log says how it ends")
    assert bench.log == [] and bench.gate.busy
    for other in MOTIONS:
        assert bench.call(other) == (False, "another goal is being executed")
    [run] = bench.begun
    run()
    given = "" if name == "open" else " in the cloud"
    assert bench.log == [f"{MOTIONS[name]}{given}", f"info: {NAMES[name]}: EXECUTION_FAILED: its words"]
    assert not bench.gate.busy


def test_a_stop_ends_a_motion(bench: Bench) -> None:
    bench.call("ready")
    bench.begun[0]()
    [should_stop] = bench.stops
    assert should_stop() is False
    bench.gate.latch("stopped on request")
    assert should_stop() is True


@pytest.mark.parametrize("name", MOTIONS)
def test_a_motion_that_fails_is_in_the_log_and_over(bench: Bench, name: str) -> None:
    bench.failure = RuntimeError("the arm is lost")
    bench.call(name)
    bench.begun[0]()
    assert bench.log[-1] == f"error: {NAMES[name]}: unexpected RuntimeError: the arm is lost"
    assert not bench.gate.busy and bench.call(name)[0]


@pytest.mark.parametrize("name", ["ready", "recover"])
def test_what_is_not_avoided_is_said_with_a_motion_that_begins(bench: Bench, name: str) -> None:
    bench.lacks = "no cloud has arrived"
    assert bench.call(name) == (True, "begun; the log says how it ends; no cloud has arrived")
    assert bench.log == [f"warning: {NAMES[name]}: no cloud has arrived"]
    assert bench.call(name) == (False, "another goal is being executed"), "nothing is added where nothing begins"
    assert len(bench.log) == 1


@pytest.mark.parametrize("name", ["ready", "recover"])
def test_what_cannot_be_avoided_at_all_lets_nothing_begin(bench: Bench, name: str) -> None:
    bench.lacks = RequestError("where the camera stands is not known")
    assert bench.call(name) == (False, "where the camera stands is not known")
    assert not bench.gate.busy and not bench.begun and not bench.log
    assert bench.call("open")[0], "the fingers open all the same"
