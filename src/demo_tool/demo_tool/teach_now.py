"""The page's commands for a better policy: learn from the open data set, and load what was learned."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from demo_tool.arguments import number_of
from demo_tool.bulletin import Bulletin
from demo_tool.errors import CommandError, NotNowError
from demo_tool.ports import Lessons, Policy
from demo_tool.recording import Recorder

_TRAINED = re.compile(r"^\[[#-]+\] (\d+)/(\d+) ")  # how the progress of `train` begins
_ERROR = "error: "
BEGINNINGS = ("auto", "none")  # what `learn --init` is offered
_MOST_MINUTES = 24 * 60
_STOPPED = 130  # exit status of a `learn` that was stopped


@dataclass(frozen=True)
class LessonState:
    """State of a lesson, as the page shows it.

    state: none, running, stopped, failed or learned; data_set: its name; words: what was said last; share: of the
    training's steps that are done, None before it begins; table: what is compared, before and after, in words; policy:
    path of what was learned.
    """

    state: str = "none"
    data_set: str = ""
    words: str = ""
    share: float | None = None
    table: tuple[tuple[str, str, str], ...] = ()
    policy: str | None = None

    def shown(self) -> dict[str, Any]:
        """Return the interface Lesson of static/protocol.d.ts."""
        return {
            "state": self.state,
            "data_set": self.data_set,
            "words": self.words,
            "share": self.share,
            "table": [list(row) for row in self.table],
            "policy": self.policy,
        }


class TeachNow:
    """Commands `teach`, `stop_teaching` and `use_learned`, for the data set that the recorder has open."""

    def __init__(self, lessons: Lessons, policy: Policy, recorder: Recorder, bulletin: Bulletin) -> None:
        self._lessons, self._policy, self._recorder, self._bulletin = lessons, policy, recorder, bulletin
        self._stopped = False
        self._error = ""
        self.lesson = LessonState()
        self.commands: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
            "teach": self._teach,
            "stop_teaching": self._stop,
            "use_learned": self._use,
        }

    def close(self) -> None:
        """Let what is being learned be saved, and end it."""
        self._lessons.close()

    def _teach(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        options = _options(arguments)
        name, data_set = self._recorder.data_set_name, self._recorder.data_set
        if name is None or data_set is None:
            raise NotNowError("open a data set first: its episodes are what is learned")
        if self._recorder.episode is not None:
            raise NotNowError("an episode is being recorded: end or discard it before anything is learned")
        if not any(info.n_steps for info in data_set.episodes()):
            raise NotNowError(f"the data set {name} has no step that could be learned")
        with self._bulletin.lock:
            if self.lesson.state == "running":
                raise NotNowError(f"the data set {self.lesson.data_set} is being learned: stop that first")
            self._stopped, self._error = False, ""
            before, self.lesson = self.lesson, LessonState("running", name, "it begins")
            try:
                self._lessons.begin(data_set.path, options, self._on_line, self._on_end)
            except NotNowError:
                self.lesson = before
                raise
        return {"words": f"the data set {name} is being learned; recording can go on"}

    def _stop(self, _: Mapping[str, Any]) -> dict[str, Any]:
        if self.lesson.state != "running":
            raise NotNowError("nothing is being learned")
        self._stopped = True
        self._lessons.stop()
        return {"words": "learning stops and saves what it has; begun again, it goes on"}

    def _use(self, _: Mapping[str, Any]) -> dict[str, Any]:
        if self.lesson.policy is None:
            raise NotNowError("nothing has been learned here yet")

        def answered(ok: bool, words: str) -> None:
            if ok:
                self._bulletin.say(words)
            else:
                self._bulletin.refuse(f"the policy stays as it is: {words}")

        self._policy.load(self.lesson.policy, answered)
        return {"words": "the policy server is asked to load what was learned"}

    def _on_line(self, line: str) -> None:
        with self._bulletin.lock:
            if line.startswith(_ERROR):
                self._error = line.removeprefix(_ERROR)
            trained = _TRAINED.match(line)
            share = int(trained[1]) / max(1, int(trained[2])) if trained else self.lesson.share
            self.lesson = replace(self.lesson, words=line[trained.end() :].strip() if trained else line, share=share)
            self._bulletin.touch()

    def _on_end(self, status: int, report: dict[str, Any] | None) -> None:
        name = self.lesson.data_set
        learned = _learned(name, report) if status in (0, _STOPPED) and report is not None else None
        with self._bulletin.lock:
            if learned is not None and status == _STOPPED:
                self.lesson = replace(learned, state="stopped", share=self.lesson.share)
                self._bulletin.say("learning has stopped: what it has can be used, and begun again it goes on")
            elif learned is not None:
                self.lesson = learned
                self._bulletin.say(f"the data set {name} is learned: look at it before and after, then use it")
            elif self._stopped:
                self.lesson = replace(self.lesson, state="stopped", words="stopped; begun again, it goes on")
                self._bulletin.say("learning has stopped, and what it has is saved")
            else:
                words = self._error or f"it ended with status {status}: {self.lesson.words}"
                self.lesson = replace(self.lesson, state="failed", words=words)
                self._bulletin.refuse(f"nothing was learned: {words}")


def _options(arguments: Mapping[str, Any]) -> list[str]:
    """Return the options of `learn` that the page's `minutes` (none: as long as it needs) and `init` mean."""
    minutes, init = arguments.get("minutes"), arguments.get("init", BEGINNINGS[0])
    if init not in BEGINNINGS:
        raise CommandError(f"'init' must be {', '.join(BEGINNINGS)}")
    if minutes is None:
        return ["--init", init]
    return ["--init", init, "--minutes", str(number_of(arguments, "minutes", 1, _MOST_MINUTES))]


def _learned(data_set: str, report: dict[str, Any]) -> LessonState | None:
    """Return the lesson that a report of `learn` describes, None where it is none."""
    try:
        table = tuple((str(what), str(before), str(after)) for what, before, after in report["table"])
        words = f"{len(report['learned'])} episodes learned, {len(report['held_out'])} held out"
        if (done := report.get("steps_done", 0)) < (steps := report.get("steps", 0)):
            words += f"; stopped after {done} of {steps} steps; begun again, it goes on"
        return LessonState("learned", data_set, words, 1.0, table, str(report["policy"]))
    except (KeyError, TypeError, ValueError):
        return None
