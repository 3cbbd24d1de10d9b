"""Commands of the page that draw, move and record, by name."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

from cliport_episodes.edits import verdict_words
from demo_tool.activity import Activity
from demo_tool.arguments import box_of, instruction_of, number_of, pixel_of, primitive_of, text_of, verdict_of
from demo_tool.arm_work import ArmWork
from demo_tool.camera_watch import BEFORE_REST, CameraWatch
from demo_tool.draft_desk import DraftDesk, DrawnAction
from demo_tool.errors import CommandError, DemoToolError, NotNowError
from demo_tool.library import Library
from demo_tool.live_view import LiveView
from demo_tool.recording import Recorder
from demo_tool.station_config import StationConfig
from demo_tool.steps import goal_of, setup_of

Answer = dict[str, Any]
Arguments = Mapping[str, Any]
Command = Callable[[Arguments], Answer]
_PICTURE_ATTEMPTS = 100  # to get a picture of the finished scene
_ATTEMPT_PERIOD = 0.02  # [s]


class PageCommands:
    """Commands of the page, by name.

    always: obeyed in every state; when_idle: only without another activity; when_saved: those of when_idle that are
    refused while there is an unsaved step, which moved the arm and could not be recorded.

    A command raises StationError, EpisodesError or CoreError when it is refused, and has no effect then. An answer's
    `words` say what was done, or, with `ok` false, why that will not do.
    """

    def __init__(
        self,
        config: StationConfig,
        watch: CameraWatch,
        desk: DraftDesk,
        work: ArmWork,
        recorder: Recorder,
        library: Library,
        now_ns: Callable[[], int],
        clock: Callable[[], float],
    ) -> None:
        self._config, self._watch, self._desk, self._work = config, watch, desk, work
        self._recorder, self._library = recorder, library
        self._now_ns, self._clock = now_ns, clock
        self.instruction = ""
        self.verdict: bool | None = None
        self.always = self._commands_obeyed_always()
        self.when_idle = self._commands_obeyed_when_idle()
        self.when_saved = frozenset(
            {"open_data_set", "execute", "record", "undo", "restore_step", "end_episode", "continue_episode"}
        )

    def _commands_obeyed_always(self) -> dict[str, Command]:
        return {
            "instruction": self._set_instruction,
            "mark": self._mark,
            "stop": self._stop,
            "approve": self._approve,
            "resume": lambda _: _answer(self._work.resume()),
        }

    def _commands_obeyed_when_idle(self) -> dict[str, Command]:
        return {
            "open_data_set": self._open_data_set,
            "primitive": self._set_primitive,
            "pick": lambda arguments: self._draw("pick", arguments),
            "place": lambda arguments: self._draw("place", arguments),
            "point": self._point,
            "clear": self._clear,
            "preview": self._preview,
            "execute": self._execute,
            "recover": lambda _: _begun(self._work.recover),
            "open_hand": lambda _: _begun(self._work.open_hand),
            "record": self._record,
            "undo": self._undo,
            "restore_step": self._restore_step,
            "save_again": lambda _: _answer(self._work.save_again()),
            "drop_unsaved": lambda _: _answer(self._work.drop_unsaved()),
            "end_episode": self._end_episode,
            "discard_episode": self._discard_episode,
            "continue_episode": self._continue_episode,
            "propose": self._propose,
            "correct": self._correct,
        }

    def check_reach(self) -> None:
        """Have the arm asked whether it can do what is drawn, once that was left alone; to be called often."""
        work, draft = self._work, self._desk.draft
        may_ask = draft.pick is not None and draft.place is not None and work.plan is None and not work.stopped
        may_ask = may_ask and work.activity is Activity.NONE and work.reach.is_free and self._problem() is None
        if work.reach.look((draft, self._desk.primitive) if may_ask else None, self._clock()):
            with suppress(DemoToolError):  # an end without a target is said beside it
                work.reach.ask(goal_of(self._drawn_action({}), self.instruction, plan_only=True))

    def _stop(self, _: Arguments) -> Answer:
        ok, words = self._work.stop("stopped on the page")
        return {"ok": ok, "words": words}

    def _set_instruction(self, arguments: Arguments) -> Answer:
        self.instruction = instruction_of(arguments)
        return _answer("the instruction is set" if self.instruction else "the instruction is empty")

    def _mark(self, arguments: Arguments) -> Answer:
        success = verdict_of(arguments)
        if arguments.get("episode") is not None:
            return self._library.mark(text_of(arguments, "episode"), success)
        if self._recorder.episode is not None:
            self.verdict = success
            return _answer(f"this episode will be recorded as: {verdict_words(success)}")
        if self._recorder.last_episode is None:
            raise NotNowError("there is no episode to mark: record a step first")
        return self._library.mark(self._recorder.last_episode, success)

    def _open_data_set(self, arguments: Arguments) -> Answer:
        name = text_of(arguments, "name")
        view = self._watch.view
        setup = setup_of(view, self._config) if view is not None else None
        words = self._work.write_to_disk(lambda: self._recorder.open(name, setup))
        self.verdict = None
        return _answer(words)

    def _set_primitive(self, arguments: Arguments) -> Answer:
        primitive = primitive_of(arguments)
        self._forget_plan()
        self._desk.choose_primitive(primitive, self._watch.view)
        return _answer(f"the arm will {primitive.label.replace('_', ' and ')}")

    def _draw(self, which: str, arguments: Arguments) -> Answer:
        view = self._fresh_view()
        box = box_of(arguments, view.camera)
        rotation = number_of(arguments, "rotation", 0, self._config.workspace.n_rotations - 1)
        self._forget_plan()
        return _drawn(which, *self._desk.draw(which, box, rotation, view))

    def _point(self, arguments: Arguments) -> Answer:
        view, which = self._fresh_view(), text_of(arguments, "end")
        if which not in ("pick", "place"):
            raise CommandError(f"'end' must be pick or place, got '{which[:20]}'")
        row, col = pixel_of(arguments, view.camera)
        rotation = number_of(arguments, "rotation", 0, self._config.workspace.n_rotations - 1)
        drawn = self._desk.point(which, row, col, rotation, view)
        self._forget_plan()
        return _drawn(which, *drawn)

    def _clear(self, _: Arguments) -> Answer:
        self._forget_plan()
        self._desk.clear()
        return _answer("nothing is drawn")

    def _preview(self, arguments: Arguments) -> Answer:
        self._work.preview(self._drawn_action(arguments), self.instruction)
        return {}

    def _execute(self, arguments: Arguments) -> Answer:
        with self._instructed(arguments) as text:
            self._work.execute(self._drawn_action(arguments), text)
        return {}

    def _approve(self, arguments: Arguments) -> Answer:
        self._work.approval.approve(text_of(arguments, "plan"), self._clock())
        return {}

    def _record(self, arguments: Arguments) -> Answer:
        with self._instructed(arguments) as text:
            return _answer(self._work.record(self._drawn_action(arguments), text))

    def _undo(self, _: Arguments) -> Answer:
        self._work.write_to_disk(self._recorder.undo_step)
        return _answer(
            "the last step is undone and can be brought back; the arm does not go back, the objects stay where they are"
        )

    def _restore_step(self, _: Arguments) -> Answer:
        self._work.write_to_disk(self._recorder.restore_step)
        return _answer("the step is back")

    def _end_episode(self, arguments: Arguments) -> Answer:
        success = verdict_of(arguments) if "success" in arguments else self.verdict
        self._recorder.refuse_to_end()
        name, seen = self._work.write_to_disk(lambda: self._finish(success))
        self.verdict = None
        without = "" if seen else "; the finished scene is not in it, because there is no picture of it"
        return _answer(f"episode {name} is saved: {verdict_words(success)}{without}")

    def _finish(self, success: bool | None) -> tuple[str, bool]:
        """End the episode; return its name, and True if it has a picture of the finished scene, waited for a moment."""
        problem, view = self._problem(), self._watch.view
        for _ in range(_PICTURE_ATTEMPTS if view is not None else 0):
            if problem is None:
                break
            time.sleep(_ATTEMPT_PERIOD)
            problem, view = self._problem(), self._watch.view
        if problem == BEFORE_REST:
            raise NotNowError(problem)
        raw = view.to_record() if problem is None and view is not None else ()
        return self._recorder.finish(raw, success), bool(raw)

    def _discard_episode(self, _: Arguments) -> Answer:
        name = self._work.write_to_disk(self._recorder.discard)
        if self._work.unsaved is not None:
            self._work.drop_unsaved()
        self.verdict = None
        return _answer(f"episode {name} is thrown away; the arm does not go back")

    def _continue_episode(self, arguments: Arguments) -> Answer:
        name = text_of(arguments, "name")
        words = self._work.write_to_disk(lambda: self._recorder.continue_episode(name))
        self.verdict = None
        return _answer(words)

    def _propose(self, arguments: Arguments) -> Answer:
        self._fresh_view()
        with self._instructed(arguments) as text:
            self._work.propose(text)
        return {}

    def _correct(self, _: Arguments) -> Answer:
        proposal = self._work.proposals.newest
        if proposal is None:
            raise NotNowError("there is no proposal to correct: ask the policy for one first")
        view = self._fresh_view()
        self._forget_plan()
        self._desk.take(proposal, view)
        return _answer("the policy's proposal is drawn: change it, then execute")

    def _forget_plan(self) -> None:
        self._work.plan = None

    @contextmanager
    def _instructed(self, arguments: Arguments) -> Iterator[str]:
        """Yield the command's `text`, or else the instruction; it becomes the instruction if the body succeeds."""
        text = instruction_of(arguments) if "text" in arguments else self.instruction
        if not text:
            raise NotNowError("type the instruction first: what is this step to do?")
        before, self.instruction = self.instruction, text
        try:
            yield text
        except BaseException:
            self.instruction = before
            raise

    def _drawn_action(self, arguments: Arguments) -> DrawnAction:
        """Return the drawn action; a command with a `draft` is refused where another one is drawn."""
        view = self._fresh_view()
        if "draft" in arguments and not self._desk.matches(arguments["draft"]):
            raise NotNowError("what is drawn has changed since this page showed it: look at the boxes, then try again")
        return self._desk.drawn_action(view)

    def _fresh_view(self) -> LiveView:
        problem = self._problem()
        view = self._watch.view
        if problem is not None or view is None:
            raise NotNowError(problem or "no picture has come yet")
        return view

    def _problem(self) -> str | None:
        return self._watch.problem(self._now_ns(), self._clock())


def _answer(text: str) -> Answer:
    return {"words": text}


def _begun(begin: Callable[[], None]) -> Answer:
    begin()
    return {}


def _drawn(which: str, ok: bool, words: str) -> Answer:
    return {"ok": ok, "words": f"{which}: {words}" if ok else words}
