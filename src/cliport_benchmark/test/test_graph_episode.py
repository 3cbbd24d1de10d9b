"""An episode through the graph, with a fake graph: sentences in their turn, step limits, and who gives up."""

from dataclasses import dataclass, field

import pytest

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.graph_episode import Played, Progress, play_episode
from cliport_interfaces.msg import PolicyStatus

EXECUTING, DONE, FAILED = PolicyStatus.STATE_EXECUTING, PolicyStatus.STATE_DONE, PolicyStatus.STATE_FAILED
LOOKING = PolicyStatus.STATE_OBSERVING


@dataclass
class Graph:
    """Plays back, look by look, what the policy and the simulator say after each sentence."""

    script: list[tuple[int, str, int, str, float]]  # state, message, step, the simulator's sentence, score
    said: list[str] = field(default_factory=list)
    looks: int = -1
    breaks_at: int = 10_000
    stale: bool = False
    dies_at: int = 10_000
    settle: float = 0.0

    def instruct(self, text: str) -> None:
        self.said.append(text)

    def newest_status(self) -> PolicyStatus | None:
        self.looks += 1
        state, message, step, _, _ = self._now()
        instruction = "something else" if self.stale else self.said[-1]
        return PolicyStatus(state=state, message=message, step=step, instruction=instruction)

    def progress(self) -> Progress:
        *_, sentence, score = self._now()
        return Progress(score, score > 0.99, sentence, self.looks >= self.breaks_at)

    def _now(self) -> tuple[int, str, int, str, float]:
        return self.script[min(max(self.looks, 0), len(self.script) - 1)]

    def simulated_time(self) -> float:
        return 5.0 * self.looks

    def play(self, max_steps: int = 14) -> Played:
        clock = iter(range(1000))
        return play_episode(
            self, "a", max_steps, 100.0, lambda: self.looks < self.dies_at, self.settle, lambda _: None,
            lambda: float(next(clock)),
        )  # fmt: skip


def test_each_sentence_is_said_when_the_one_before_is_reached() -> None:
    graph = Graph([
        (EXECUTING, "moving", 1, "a", 0.0),
        (EXECUTING, "moving", 1, "b", 0.5),
        (EXECUTING, "moving", 1, "b", 0.5),
        (LOOKING, "looking", 1, "b", 1.0),
    ])  # fmt: skip
    played = graph.play()
    assert graph.said == ["a", "b", ""] and played.sentences == ("a", "b")
    assert played.steps == 2 and played.ended_well and played.score == 1.0


def test_what_a_task_says_at_its_end_is_not_spoken() -> None:
    graph = Graph([(EXECUTING, "moving", 1, "solved.", 1.0)] * 3 + [(LOOKING, "looking", 1, "solved.", 1.0)])
    played = graph.play()
    assert graph.said == ["a", ""] and played.score == 1.0 and played.ended_well


def test_an_episode_ends_where_things_flew_apart() -> None:
    graph = Graph([(EXECUTING, "moving", 1, "a", 0.25)] * 2 + [(LOOKING, "looking", 2, "a", 0.25)] * 9, breaks_at=2)
    played = graph.play()
    assert graph.said == ["a", ""] and (graph.looks, played.steps, played.score) == (2, 2, 0.25)
    assert not played.ended_well


def test_the_servers_own_limit_does_not_end_a_task_that_allows_more() -> None:
    limit = (FAILED, "step limit of 8 reached", 8, "a", 0.2)
    graph = Graph([limit, limit, (LOOKING, "looking", 4, "a", 1.0)])
    played = graph.play(max_steps=20)
    assert graph.said == ["a", "a", "a", ""] and played.steps == 20 and played.score == 1.0


def test_the_tasks_limit_and_a_policy_that_gives_up_end_it() -> None:
    limit = (FAILED, "step limit of 8 reached", 8, "a", 0.2)
    assert Graph([limit]).play(max_steps=8).steps == 8
    lost = Graph([(FAILED, "what 'a' names is not to be seen", 0, "a", 0.0)]).play()
    assert not lost.ended_well and lost.steps == 0
    done = Graph([(DONE, "the goal looks reached already", 0, "a", 0.0)])
    assert done.play().ended_well and done.said == ["a", ""]


def test_a_motion_that_failed_costs_a_step_and_does_not_end_it() -> None:
    failed = (FAILED, "executor: GRASP_MISSED: the fingers closed on nothing", 1, "a", 0.0)
    graph = Graph([failed, (LOOKING, "looking", 0, "a", 0.0), (LOOKING, "looking", 1, "a", 1.0)])
    played = graph.play()
    assert graph.said == ["a", "a", ""] and (played.steps, played.score) == (2, 1.0)
    assert Graph([failed]).play(max_steps=3).steps == 3


@pytest.mark.parametrize(("state", "words"), [(DONE, "reached"), (FAILED, "what 'a' names is not to be seen")])
def test_an_end_waits_until_the_simulator_has_judged_what_was_done(state: int, words: str) -> None:
    done = (state, words, 1, "a", 0.0)
    late = [(LOOKING, "looking", 1, "a", 0.0), done, done, (state, words, 1, "b", 0.5)]
    reached = (LOOKING, "looking", 1, "b", 1.0)
    assert Graph([*late, reached], settle=12.0).play().sentences == ("a", "b")
    assert Graph([*late, reached]).play().sentences == ("a",), "the test can tell"


@pytest.mark.parametrize(
    "words",
    [
        "executor: CANCELLED: no guard was heard for 3 s",
        "executor: EXECUTION_FAILED: somebody else cancelled it; look, then call /panda_executor/recover",
        "executor: EXECUTION_FAILED: the arm may still move after carry; look before you go on",
    ],
)
def test_nobody_tries_again_after_a_stop_at_the_executor(words: str) -> None:
    graph = Graph([(FAILED, words, 1, "a", 0.0)])
    assert graph.play().steps == 1 and graph.said == ["a", ""]


def test_a_stop_or_the_graphs_end_is_no_result() -> None:
    with pytest.raises(BenchmarkError, match="somebody stopped the policy: stopped: call /cliport/resume to go on"):
        Graph([(PolicyStatus.STATE_IDLE, "stopped: call /cliport/resume to go on", 1, "a", 0.25)]).play()
    with pytest.raises(BenchmarkError, match="the graph ended"):
        Graph([(EXECUTING, "moving", 1, "a", 0.0)], dies_at=3).play()


def test_what_the_arm_carries_over_its_target_is_not_there_yet() -> None:
    carrying = (EXECUTING, "step 1: LOWER", 1, "a", 1.0)
    played = Graph([carrying, carrying, (LOOKING, "waiting", 1, "a", 0.5), (DONE, "reached", 1, "a", 0.5)]).play()
    assert played.score == 0.5 and played.message == "reached"


def test_a_status_of_the_sentence_before_is_not_taken_for_this_ones() -> None:
    graph = Graph([(DONE, "the goal looks reached", 3, "a", 0.0)], stale=True)
    played = graph.play()
    assert played.steps == 0 and not played.ended_well  # time ran out
