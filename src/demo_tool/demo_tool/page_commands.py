"""The commands of the page that draw, move and record, by name."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from demo_tool.arguments import box_of, instruction_of, number_of, primitive_of, text_of, verdict_of
from demo_tool.arm_work import ArmWork
from demo_tool.camera_watch import BEFORE_REST, CameraWatch
from demo_tool.draft_desk import Choice, DraftDesk
from demo_tool.errors import NotNowError
from demo_tool.library import Library
from demo_tool.live_view import LiveView
from demo_tool.recording import Recorder
from demo_tool.station_config import StationConfig
from demo_tool.steps import setup_of
from demo_tool.wording import verdict_words

Answer = dict[str, Any]
Arguments = Mapping[str, Any]
_LOOKS, _BETWEEN_LOOKS_S = 100, 0.02  # for a picture of the finished scene


class PageCommands:
    """always: obeyed in every state; when_idle: only while nothing is going on.

    A command raises StationError, EpisodesError or PerceptionError when it is refused; then all is as before. An
    answer's `words` say what was done; with `ok` false, why that will not do.
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
        self.always: dict[str, Callable[[Arguments], Answer]] = {
            "instruction": self._set_instruction,
            "mark": self._mark,
            "stop": lambda _: _words(work.stop("stopped on the page")),
            "resume": lambda _: _words(work.resume()),
        }
        self.when_idle: dict[str, Callable[[Arguments], Answer]] = {
            "open_data_set": self._open_data_set,
            "primitive": self._set_primitive,
            "pick": lambda arguments: self._draw("pick", arguments),
            "place": lambda arguments: self._draw("place", arguments),
            "clear": self._clear,
            "preview": self._preview,
            "execute": self._execute,
            "record": self._record,
            "undo": self._undo,
            "end_episode": self._end_episode,
            "discard_episode": self._discard_episode,
            "propose": self._propose,
            "correct": self._correct,
        }

    def _set_instruction(self, arguments: Arguments) -> Answer:
        self.instruction = instruction_of(arguments)
        return _words("the instruction is set" if self.instruction else "the instruction is empty")

    def _mark(self, arguments: Arguments) -> Answer:
        success = verdict_of(arguments)
        if arguments.get("episode") is not None:
            return self._library.mark(text_of(arguments, "episode"), success)
        if self._recorder.episode is not None:
            self.verdict = success
            return _words(f"this episode will be recorded as: {verdict_words(success)}")
        if self._recorder.last_episode is None:
            raise NotNowError("there is no episode to mark: record a step first")
        return self._library.mark(self._recorder.last_episode, success)

    def _open_data_set(self, arguments: Arguments) -> Answer:
        name = text_of(arguments, "name")
        view = self._watch.view
        setup = setup_of(view, self._config) if view is not None else None
        self.verdict = None
        return _words(self._work.on_disk(lambda: self._recorder.open(name, setup)))

    def _set_primitive(self, arguments: Arguments) -> Answer:
        primitive = primitive_of(arguments)
        self._changed_draft()
        self._desk.choose_primitive(primitive, self._watch.view)
        return _words(f"the arm will {primitive.name.lower().replace('_', ' and ')}")

    def _draw(self, which: str, arguments: Arguments) -> Answer:
        view = self._fresh_view()
        box = box_of(arguments, view.camera)
        rotation = number_of(arguments, "rotation", 0, self._config.workspace.n_rotations - 1)
        self._changed_draft()
        ok, words = self._desk.draw(which, box, rotation, view)
        return {"ok": ok, "words": f"{which}: {words}" if ok else words}

    def _clear(self, _: Arguments) -> Answer:
        self._changed_draft()
        self._desk.clear()
        return _words("nothing is drawn")

    def _preview(self, _: Arguments) -> Answer:
        self._work.preview(self._choice(), self.instruction)
        return {}

    def _execute(self, _: Arguments) -> Answer:
        self._work.execute(self._choice(), self._instruction_given())
        return {}

    def _record(self, _: Arguments) -> Answer:
        return _words(self._work.record(self._choice(), self._instruction_given()))

    def _undo(self, _: Arguments) -> Answer:
        self._work.on_disk(self._recorder.undo_step)
        return _words("the last step is dropped; the arm does not go back, and the objects stay where they are")

    def _end_episode(self, arguments: Arguments) -> Answer:
        success = verdict_of(arguments) if "success" in arguments else self.verdict
        self._recorder.refuse_to_end()
        name, seen = self._work.on_disk(lambda: self._finish(success))
        self.verdict = None
        without = "" if seen else "; the finished scene is not in it, because there is no picture of it"
        return _words(f"episode {name} is saved: {verdict_words(success)}{without}")

    def _finish(self, success: bool | None) -> tuple[str, bool]:
        """The episode's name, and whether it has the finished scene, whose picture is waited for a moment."""
        problem, view = self._problem(), self._watch.view
        for _ in range(_LOOKS if view is not None else 0):
            if problem is None:
                break
            time.sleep(_BETWEEN_LOOKS_S)
            problem, view = self._problem(), self._watch.view
        if problem == BEFORE_REST:
            raise NotNowError(problem)
        raw = view.raw if problem is None and view is not None else ()
        return self._recorder.finish(raw, success), bool(raw)

    def _discard_episode(self, _: Arguments) -> Answer:
        name = self._work.on_disk(self._recorder.discard)
        self.verdict = None
        return _words(f"episode {name} is thrown away; the arm does not go back")

    def _propose(self, _: Arguments) -> Answer:
        self._fresh_view()
        self._work.propose(self._instruction_given())
        return {}

    def _correct(self, _: Arguments) -> Answer:
        proposal = self._work.proposal
        if proposal is None:
            raise NotNowError("there is no proposal to correct: ask the policy for one first")
        view = self._fresh_view()
        self._changed_draft()
        self._desk.take(proposal, view)
        return _words("the policy's proposal is drawn: change it, then execute")

    def _changed_draft(self) -> None:
        self._work.plan = None

    def _instruction_given(self) -> str:
        if not self.instruction:
            raise NotNowError("type the instruction first: what is this step to do?")
        return self.instruction

    def _choice(self) -> Choice:
        return self._desk.choice(self._fresh_view())

    def _fresh_view(self) -> LiveView:
        problem = self._problem()
        view = self._watch.view
        if problem is not None or view is None:
            raise NotNowError(problem or "no picture has come yet")
        return view

    def _problem(self) -> str | None:
        return self._watch.problem(self._now_ns(), self._clock())


def _words(text: str) -> Answer:
    return {"words": text}
