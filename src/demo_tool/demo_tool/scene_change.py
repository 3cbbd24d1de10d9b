"""The page's command for another scene, where a simulator runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from demo_tool.bulletin import Bulletin
from demo_tool.errors import NotNowError
from demo_tool.ports import Scenes
from demo_tool.recording import Recorder


class SceneChange:
    """Command `new_scene`. What is drawn on the old scene is forgotten at once, so that nothing moves in between.

    scenes: of the simulator; None: there is none. on_change: told the sentence that is asked for in the new scene, and
    before, while it is being made, an empty one.
    """

    def __init__(
        self, scenes: Scenes | None, recorder: Recorder, bulletin: Bulletin, on_change: Callable[[str], None]
    ) -> None:
        self._scenes, self._recorder, self._bulletin, self._on_change = scenes, recorder, bulletin, on_change
        self.commands: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {"new_scene": self._new_scene}

    @property
    def is_offered(self) -> bool:
        """True if there is a simulator that makes another scene."""
        return self._scenes is not None and self._scenes.are_offered()

    def _new_scene(self, _: Mapping[str, Any]) -> dict[str, Any]:
        if self._scenes is None or not self._scenes.are_offered():
            raise NotNowError("no simulator is here that could make another scene")
        if self._recorder.episode is not None and self._recorder.episode["steps"]:
            raise NotNowError("an episode is being recorded: end or discard it before a new scene")
        with self._bulletin.lock:
            self._on_change("")
        self._scenes.change(self._on_answer)
        return {"words": "the simulator is making another scene"}

    def _on_answer(self, ok: bool, words: str) -> None:
        if not ok:
            self._bulletin.refuse(f"there is no new scene: {words}")
            return
        with self._bulletin.lock:
            self._on_change(words)
            self._bulletin.say(f"a new scene: {words}")
