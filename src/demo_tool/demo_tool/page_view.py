"""View of the station for the page: everything that it shows, as plain values."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from demo_tool.activity import Activity
from demo_tool.arm_work import ArmWork
from demo_tool.box_target import to_pixels
from demo_tool.bulletin import Bulletin
from demo_tool.camera_watch import BEFORE_REST, CameraWatch
from demo_tool.draft_desk import DraftDesk
from demo_tool.page_commands import PageCommands
from demo_tool.recording import Recorder
from demo_tool.station_config import StationConfig
from demo_tool.wording import phase_words


class PageView:
    """View of a station's parts as the page shows them; clock: steady time [s]."""

    def __init__(
        self,
        config: StationConfig,
        bulletin: Bulletin,
        watch: CameraWatch,
        desk: DraftDesk,
        work: ArmWork,
        recorder: Recorder,
        page: PageCommands,
        clock: Callable[[], float],
    ) -> None:
        self._config, self._bulletin, self._watch = config, bulletin, watch
        self._desk, self._work, self._recorder, self._page = desk, work, recorder, page
        self._clock = clock

    def values(self, holder: str | None, now_ns: int, policy_state: str, policy_words: str) -> dict[str, Any]:
        """Return the interface View of static/protocol.d.ts, but for what the station and the web server add.

        holder: holder of the arm, passed through; now_ns: ROS time [ns]; policy_state, policy_words: the policy
        server's state, and that with its message. The bulletin's lock is held by the caller.
        """
        problem = self._watch.problem(now_ns, self._clock())
        state, words = self._state(problem)
        phase, progress = self._work.progress
        unsaved = self._work.unsaved  # read once: the thread that writes changes it without the lock
        return {
            "state": state,
            "words": words,
            "instruction": self._page.instruction,
            "history": list(self._recorder.history),
            "primitive": self._desk.primitive.label,
            "n_rotations": self._config.workspace.n_rotations,
            "draft": {**self._desk.shown(), "source": self._desk.draft.source.name.lower()},
            "plan": self._work.plan,
            "phase": phase_words(phase) if phase else "",
            "progress": progress,
            "approval": self._work.approval.shown(),
            "away": self._work.recovery.is_needed,
            "held_width": self._work.recovery.held_width,
            "data_set": self._recorder.data_set_name,
            "recorded": self._recorder.recorded,
            "covered": self._recorder.covered,
            "episode": self._recorder.episode,
            "verdict": self._page.verdict,
            "unsaved": unsaved.words if unsaved is not None else None,
            "data_sets": list(self._recorder.data_set_names),
            "policy": {
                "state": policy_state,
                "words": policy_words,
                "proposal": self._proposal_shown(),
            },
            "camera": self._camera_shown(now_ns),
            "holder": holder,
            "last": dict(self._bulletin.last),
        }

    def _state(self, problem: str | None) -> tuple[str, str]:
        activity, words = self._work.present()
        if self._work.stopped:
            running = f" (still {activity.words})" if activity is not Activity.NONE else ""
            words = self._work.stop_failure or "nothing moves until you resume"
            return "stopped", f"Stopped{running}: {words}."
        if activity is not Activity.NONE:
            return activity.value, f"{activity.words.capitalize()}: {words}."
        if problem is not None and not (self._bulletin.failure and problem == BEFORE_REST):
            return ("waiting_for_camera" if self._watch.view is None else "stale"), _sentence(problem)
        if self._bulletin.failure:
            return "failed", _sentence(self._bulletin.failure)
        return "ready", self._next_hint()

    def _next_hint(self) -> str:
        if self._recorder.data_set_name is None:
            return "Ready: open a data set to record in."
        if not self._page.instruction:
            return "Ready: type what the next step is to do."
        for which in ("pick", "place"):
            if getattr(self._desk.draft, which) is None:
                return f"Ready: draw the {which} box."
        return "Ready: execute, or only record."

    def _camera_shown(self, now_ns: int) -> dict[str, Any]:
        view = self._watch.view
        age = self._watch.age(now_ns)
        return {
            "width": view.camera.width if view is not None else 0,
            "height": view.camera.height if view is not None else 0,
            "age_ms": round(1000 * age) if view is not None else None,
            "fps": round(self._watch.rate(self._clock()), 1),
        }

    def _proposal_shown(self) -> dict[str, Any] | None:
        proposal, view = self._work.proposals.newest, self._watch.view
        if proposal is None or view is None:
            return None
        workspace, z = self._config.workspace, self._config.box.table_z
        action = proposal.action
        ends = (("pick", action.pick), ("place", action.place))
        shown: dict[str, Any] = {"instruction": proposal.instruction, "confidence": action.confidence}
        for which, pose in ends:
            shown[f"{which}_pixel"] = to_pixels(view, np.array([[pose.x, pose.y, z]]))[0]
            shown[f"{which}_rotation"] = workspace.bin_of_yaw(pose.yaw)
        return shown


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:] + ("" if words.endswith((".", "?", "!")) else ".")
