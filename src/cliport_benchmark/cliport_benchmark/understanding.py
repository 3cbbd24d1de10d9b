"""Questions to a policy about scenes: held-out wordings, things that are not there, goals that are reached.

Each scene is looked at as the camera sees it; the expert does what is to be done, without the arm, so that a policy's
answers do not hang on its own actions. What an answer means in the scene, the task's own judge says.
"""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cliport_benchmark.errors import OptionError
from cliport_benchmark.kinematic_hand import KinematicHand
from cliport_benchmark.observer import Observer
from cliport_benchmark.own_setup import OwnSetup
from cliport_benchmark.survey_colors import paint
from cliport_benchmark.wording import Wording, held_out_patterns
from cliport_core import Heightmap
from cliport_policy.data.named_things import named_things
from cliport_policy.errors import InstructionError
from cliport_policy.inference import NullAction
from cliport_policy.server.types import ServerConfig
from sim_bridge.errors import LayoutError, PhysicsError
from sim_bridge.scene import Stream, reset_scene, scene_rng
from sim_bridge.tasks import LANGUAGE_SPLITS, Task, make_task
from sim_bridge.world import SimWorld

if TYPE_CHECKING:
    from cliport_policy.policy import Policy

_OWN_SHARE = 0.75  # of sentences about what is absent, these are of the scene's own task
_TRIES = 40  # sentences looked at for one that names something absent
_OTHER_SCENES = 10_000  # added to a seed: their sentences are asked, and they are of no scene that is shown


class Asked(Enum):
    """Kind of a question, by what would be right."""

    WORDING = "held-out wording"  # the right thing to the right place
    OPEN = "work is left"  # an action, whichever: the task's own sentence
    REACHED = "goal is reached"  # done
    ABSENT = "thing is not here"  # not here


_JUDGED = (Asked.WORDING, Asked.OPEN)  # what an action would mean is known


@dataclass(frozen=True)
class Question:
    """One question and its answer: "act", or the null action's name, or "refused".

    picked, place: what an action would take and where it would put it, "" for nothing; each right or not. They are the
    action that would be taken if the null actions were not heard. primitive: the name of that action's, "" where the
    sentence was refused. done_probability: how likely the policy held it that nothing remains to be done.
    """

    task: str
    seed: int
    asked: str
    sentence: str
    answer: str
    picked: str = ""
    place: str = ""
    pick_right: bool = False
    place_right: bool = False
    primitive: str = ""
    done_probability: float = 0.0

    @property
    def right(self) -> bool:
        """True for the answer that is right for the kind of question."""
        if self.asked == Asked.WORDING.value:
            return self.answer == "act" and self.pick_right and self.place_right
        wanted = {Asked.REACHED: NullAction.DONE.value, Asked.ABSENT: NullAction.ABSENT.value, Asked.OPEN: "act"}
        return self.answer == wanted[Asked(self.asked)]


class Examined(NamedTuple):
    """Questions about one scene; whole: False if it could not be made or flew apart, so that more would be asked."""

    questions: list[Question]
    whole: bool


class Examiner:
    """Asks a policy about scenes of the language-conditioned splits.

    survey_colors: things are painted and called in colours of a survey that no demonstration named.
    """

    def __init__(self, policy: Policy, split: str, survey_colors: bool = False) -> None:
        """Make a world.

        Raises:
            OptionError: if the policy acts on an image of the goal, or was trained for another workspace.
        """
        setup = OwnSetup()
        if policy.needs_goal_image:
            raise OptionError("a policy that acts on an image of the goal hears no sentences: give another checkpoint")
        if policy.workspace != setup.workspace:
            raise OptionError(f"the checkpoint was trained for {policy.workspace}, not for {setup.workspace}")
        self._policy, self._split, self._survey_colors = policy, split, survey_colors
        self._limits = ServerConfig()
        self.world = SimWorld(setup.sim_config())
        self._observer = Observer(self.world.config, n_threads=1)

    def examine(self, task_name: str, seed: int, index: int) -> Examined:
        """Ask about one scene, of a seed; index says which of the wordings, in turn."""
        found: list[Question] = []
        try:
            for question in self._examine(task_name, seed, index):
                found.append(question)
        except (LayoutError, PhysicsError):
            return Examined(found, False)
        return Examined(found, True)

    def _examine(self, task_name: str, seed: int, index: int) -> Iterator[Question]:
        self.world.paints = {}
        task = make_task(task_name, self._split)
        said = Wording(synonyms=paint(self.world, task, seed) if self._survey_colors else {})
        task = reset_scene(self.world, task_name, self._split, seed)
        streams = (Stream.SCORED_NOISE, Stream.HAND, Stream.AGENT)
        noise, hand_rng, rng = (scene_rng(task.name, task.split, seed, stream) for stream in streams)
        self._observer.new_scene(noise)
        first = self._look()
        if task.sentence_slots:  # a sentence of another form cannot be reworded
            patterns = held_out_patterns(task)
            reworded = dataclasses.replace(said, patterns=(patterns[index % len(patterns)],))
            yield self._ask(Asked.WORDING, task, seed, first, _say(task, reworded))
        things = {(thing.color, thing.name) for thing in self.world.objects}
        yield from self._follow(task, seed, said, KinematicHand(self.world, hand_rng), first)
        sentence = self._about_what_is_absent(task_name, seed, said, things, rng)
        if sentence:
            yield self._ask(Asked.ABSENT, task, seed, first, sentence)

    def _follow(
        self, task: Task, seed: int, said: Wording, hand: KinematicHand, observation: Heightmap
    ) -> Iterator[Question]:
        """Have the expert act to the end, and ask at each step whether the goal of now, and that of before, is done."""
        for _ in range(task.max_steps):
            sentence, goals_before = _say(task, said), task.goals_reached
            yield self._ask(Asked.OPEN, task, seed, observation, sentence)
            action = task.expert_action()
            if action is None:
                return
            hand.execute(action, self._observer.frame(self.world))
            task.advance()
            observation = self._look()
            if task.done() or task.goals_reached > goals_before:
                yield self._ask(Asked.REACHED, task, seed, observation, sentence)
            if task.done():
                return

    def _look(self) -> Heightmap:
        return self._observer.heightmap(self._observer.frame(self.world))

    def _ask(self, asked: Asked, task: Task, seed: int, observation: Heightmap, sentence: str) -> Question:
        try:
            inference = self._policy.infer(observation, sentence)
        except InstructionError:
            return Question(task.name, seed, asked.value, sentence, "refused")
        null = inference.null_action(self._limits.done_threshold, self._limits.absent_threshold)
        answered = Question(
            task.name,
            seed,
            asked.value,
            sentence,
            null.value if null else "act",
            primitive=inference.action.primitive.label,
            done_probability=inference.done_probability,
        )
        if asked not in _JUDGED:
            return answered
        meant = task.judge(inference.action.pick, inference.action.place)
        return dataclasses.replace(answered, **dataclasses.asdict(meant))

    def _about_what_is_absent(
        self, task_name: str, seed: int, said: Wording, things: set[tuple[str, str]], rng: np.random.Generator
    ) -> str:
        """Return another scene's sentence that names what is not among these things, "" if none was found.

        It makes other scenes in the world.
        """
        for trial in range(_TRIES):
            name = task_name if rng.random() < _OWN_SHARE else str(rng.choice(LANGUAGE_SPLITS))
            other = reset_scene(self.world, name, self._split, seed + _OTHER_SCENES + trial)
            named = named_things(other.instruction)
            if named and not named.are_among(things):
                return _say(other, said)
        return ""


def _say(task: Task, wording: Wording) -> str:
    """Return the task's sentence in a wording; where it has another form than the task's pattern, with other colours'
    names alone."""
    if task.sentence_slots:
        return wording.sentence(task.sentence_pattern, task.sentence_slots, 0)
    return dataclasses.replace(wording, patterns=()).sentence("{own}", {"own": task.instruction}, 0)


def shares(questions: Sequence[Question]) -> dict[str, Any]:
    """Return the number of questions of each kind and how many answers were right, of all tasks and of each.

    Where an action is wanted, also how often it would take the right thing, put it to the right place, and both.
    """
    by_task: dict[str, list[Question]] = defaultdict(list)
    for question in questions:
        by_task[question.task].append(question)
    return {
        "all": _kinds(questions),
        "tasks": {task: _kinds(asked) for task, asked in sorted(by_task.items())},
    }


def _kinds(questions: Sequence[Question]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for kind in Asked:
        asked = [question for question in questions if question.asked == kind.value]
        answers: dict[str, int] = defaultdict(int)
        for question in asked:
            answers[question.answer] += 1
        found[kind.value] = {"asked": len(asked), "right": sum(q.right for q in asked), "answers": dict(answers)}
        if kind in _JUDGED:
            acted = [question for question in asked if question.answer == "act"]
            found[kind.value] |= {
                "thing_right": sum(question.pick_right for question in acted),
                "place_right": sum(question.place_right for question in acted),
                "both_right": sum(question.pick_right and question.place_right for question in acted),
            }
    return found
