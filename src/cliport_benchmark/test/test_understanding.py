"""Questions about scenes: each kind is asked where its answer is known, and right answers are told from wrong ones."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cliport_benchmark import understanding, understanding_cli
from cliport_benchmark.errors import OptionError
from cliport_benchmark.own_setup import OwnSetup
from cliport_benchmark.survey_colors import draw_colors
from cliport_benchmark.understanding import Asked, Examiner, Question, shares
from cliport_benchmark.wording import held_out_patterns
from cliport_core import PickPlaceAction, PlanarPose
from cliport_policy.data.named_things import named_things
from cliport_policy.inference import Inference
from sim_bridge.errors import PhysicsError
from sim_bridge.scene import reset_scene
from sim_bridge.tasks import Task, make_task
from sim_bridge.world import SimWorld

HANOI, BOWLS = "towers-of-hanoi-seq-seen-colors", "put-blocks-in-bowls-seen-colors"
NOTHING = PickPlaceAction(PlanarPose(0.27, -0.49, 0.0), PlanarPose(0.27, -0.49, 0.0))
Answer = Callable[[str], Inference]


def inference(action: PickPlaceAction | None = None, done: float = 0.0, absent: float = 0.0) -> Inference:
    return Inference(action or NOTHING, (0, 0), (0, 0), 1.0, 1.0, done, absent_probability=absent)


@pytest.fixture
def examine() -> Iterator[Callable[..., list[Question]]]:
    """Return a function that asks a policy of that answer about a scene of a task."""
    made: list[Examiner] = []

    def ask(answer: Answer, task: str, seed: int = 3, **options: Any) -> list[Question]:
        policy = SimpleNamespace(
            needs_goal_image=False, workspace=OwnSetup().workspace, infer=lambda _, sentence: answer(sentence)
        )
        made.append(Examiner(policy, "val", **options))  # type: ignore[arg-type]
        examined = made[-1].examine(task, seed, 0)
        assert examined.whole
        return examined.questions

    yield ask
    for one in made:
        one.world.close()


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[Task]:
    """Return the list of tasks that an examiner sets up, as it does so."""
    tasks: list[Task] = []
    reset = understanding.reset_scene

    def noted(*args: Any) -> Task:
        tasks.append(reset(*args))
        return tasks[-1]

    monkeypatch.setattr(understanding, "reset_scene", noted)
    return tasks


def test_who_does_as_the_expert_and_knows_the_end_is_right_throughout(
    examine: Callable[..., list[Question]], shown: list[Task]
) -> None:
    heard: list[str] = []

    def oracle(sentence: str) -> Inference:
        task, *others = shown
        heard.append(sentence)
        if others:
            return inference(absent=0.9)
        is_to_do = len(heard) == 1 or (sentence == task.instruction and not task.done())
        return inference(task.expert_action()) if is_to_do else inference(done=0.9)

    answers = examine(oracle, HANOI)
    kinds = [answer.asked for answer in answers]
    assert kinds[0] == Asked.WORDING.value and kinds[-1] == Asked.ABSENT.value
    assert kinds.count(Asked.OPEN.value) == kinds.count(Asked.REACHED.value) == 7  # moves of three rings
    assert [answer for answer in answers if not answer.right] == []
    counts = shares(answers)["all"]
    assert (counts[Asked.WORDING.value]["both_right"], counts[Asked.OPEN.value]["both_right"]) == (1, 7)
    pattern = held_out_patterns(make_task(HANOI, "val"))[0]
    assert answers[0].sentence.startswith(pattern.split("{")[0]) and "ring" in answers[0].picked


def test_who_always_acts_somewhere_is_right_only_where_work_is_left(examine: Callable[..., list[Question]]) -> None:
    answers = examine(lambda _: inference(), BOWLS)
    counts = shares(answers)["all"]
    assert counts[Asked.WORDING.value] | {"asked": 1, "right": 0, "thing_right": 0} == counts[Asked.WORDING.value]
    assert counts[Asked.OPEN.value]["right"] == counts[Asked.OPEN.value]["asked"] > 0
    assert counts[Asked.OPEN.value]["thing_right"] == counts[Asked.OPEN.value]["both_right"] == 0
    assert counts[Asked.REACHED.value] == {"asked": 1, "right": 0, "answers": {"act": 1}}
    assert counts[Asked.ABSENT.value] == {"asked": 1, "right": 0, "answers": {"act": 1}}


def test_the_absent_thing_is_absent_and_done_is_no_answer_to_it(
    examine: Callable[..., list[Question]], shown: list[Task]
) -> None:
    answers = examine(lambda _: inference(done=0.6, absent=0.4), BOWLS, seed=5)
    last = answers[-1]
    named = named_things(last.sentence)
    assert named is not None and last.asked == Asked.ABSENT.value
    assert not named.are_among({(thing.color, thing.name) for thing in shown[0].goals[0].objects})
    assert last.answer == "done" and not last.right
    assert len(shown) > 1 and shown[-1].instruction == last.sentence  # it is another scene's
    assert shares(answers)["all"][Asked.OPEN.value]["right"] == 0
    assert shares(answers)["tasks"][BOWLS][Asked.REACHED.value]["right"] == 1


def test_painted_scenes_are_called_by_the_surveys_names(examine: Callable[..., list[Question]]) -> None:
    answers = examine(lambda _: inference(), BOWLS, survey_colors=True)
    plain = examine(lambda _: inference(), BOWLS)
    assert [answer.asked for answer in answers] == [answer.asked for answer in plain]
    assert all(a.sentence != b.sentence for a, b in zip(answers, plain, strict=True))
    names = draw_colors(make_task(BOWLS, "val"), 3)
    assert answers[-1].asked == Asked.ABSENT.value
    assert answers[-1].sentence == re.sub("|".join(names), lambda color: names[color[0]], plain[-1].sentence)


def test_a_sentence_of_another_form_is_no_held_out_wording_and_names_the_paints(
    examine: Callable[..., list[Question]], shown: list[Task]
) -> None:
    boxes = "packing-box-pairs-seen-colors"
    world = SimWorld()
    for seed in range(30):
        task = reset_scene(world, boxes, "val", seed)
        own, names = task.goals[0].sentence, draw_colors(task, seed)
        colors = [word for word in own.split()[:4] if word in names]  # brown, as the box is, keeps its name
        if colors and " and " not in own:
            break
    world.close()
    painted = examine(lambda _: inference(), boxes, seed=seed, survey_colors=True)
    assert shown[0].goals[0].sentence == own
    assert Asked.WORDING.value not in {question.asked for question in painted}
    assert painted[0].sentence == own.replace(colors[0], names[colors[0]])


def test_a_scene_that_breaks_gives_what_was_asked_until_then(monkeypatch: pytest.MonkeyPatch) -> None:
    def flies_apart(*_: Any) -> None:
        raise PhysicsError("things flew apart")

    monkeypatch.setattr(understanding.KinematicHand, "execute", flies_apart)
    policy = SimpleNamespace(needs_goal_image=False, workspace=OwnSetup().workspace, infer=lambda *_: inference())
    examiner = Examiner(policy, "val")  # type: ignore[arg-type]
    found = examiner.examine(BOWLS, 3, 0)
    examiner.world.close()
    assert not found.whole and [question.asked for question in found.questions] == [
        Asked.WORDING.value,
        Asked.OPEN.value,
    ]
    report = {"tasks": {}, "all": shares(found.questions)["all"], "broken_scenes": 1}
    assert understanding_cli.table(report).endswith("1 scenes broke, so that not all of their questions were asked")


def test_a_policy_that_hears_no_sentence_is_refused() -> None:
    with pytest.raises(OptionError, match="hears no sentences"):
        Examiner(SimpleNamespace(needs_goal_image=True), "val")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--task", "block-insertion"], "block-insertion has no held-out wordings: choose one of the 18"),
        (["--episodes", "0"], "--episodes must be 1 or more, got 0"),
        (["--task", "packing-seen-google-objects-seq", "--survey-colors"], "cannot paint the things of"),
        (["--checkpoint", "nobody"], "nobody"),
    ],
)
def test_what_cannot_be_asked_is_refused_in_one_line(
    options: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert understanding_cli.main([*options, "--out", str(tmp_path / "u.json")]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ") and words in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_the_shipped_policy_is_asked_and_what_it_got_wrong_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "u.json"
    asked = ["--task", BOWLS, "--split", "val", "--episodes", "2", "--processes", "1", "--out", str(out)]
    assert understanding_cli.main(asked) == 0
    report = json.loads(out.read_text())
    counts = report["tasks"][BOWLS]
    assert report["broken_scenes"] == 0
    assert report["all"] == counts and counts[Asked.WORDING.value]["asked"] == 2
    assert counts[Asked.OPEN.value]["right"] >= 2
    wrong = sum(kind["asked"] - kind["right"] for kind in counts.values())
    assert len(report["wrong"]) == wrong and report["weights_sha256"] and report["commit"]
    assert (
        "held-out wording: thing right in 2, place right in 2, both right in 2 of 2; answered"
        in capsys.readouterr().out
    )
