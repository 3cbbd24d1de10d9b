"""Another scene of the simulator, asked for on the page."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

from demo_tool.scene_change import SceneChange


def test_another_scene_brings_its_sentence_and_forgets_what_was_drawn(bench) -> None:
    bench.begin()
    bench.draw()
    assert bench.view["scenes"] is True and bench.view["draft"]["pick"] is not None
    assert "is making another scene" in bench.do("new_scene")["words"]
    assert bench.view["instruction"] == "put block 1 in the bowl"
    assert bench.view["draft"]["pick"] is None and bench.view["draft"]["place"] is None
    assert bench.view["last"] == {"ok": True, "words": "the simulator is making another scene"}
    bench.refused("execute")
    assert bench.view["state"] == "stale", "the old picture counts no more"
    bench.draw()
    bench.do("record")
    assert bench.steps[0]["instruction"] == "put block 1 in the bowl"


def test_nothing_moves_while_the_scene_is_being_made(bench) -> None:
    """What was drawn on the old scene would be recorded as done in the new one."""
    bench.begin()
    bench.draw()
    answers: list[Callable[[bool, str], None]] = []
    bench.scenes.change = answers.append
    bench.do("new_scene")
    bench.rest()
    assert "draw the pick and the place" in bench.refused("execute", text="put it there")
    answers[0](True, "put block 2 in the bowl")
    assert (bench.view["instruction"], bench.view["state"]) == ("put block 2 in the bowl", "stale")


def test_no_scene_changes_within_an_episode_or_while_something_goes_on(bench, held) -> None:
    bench.begin()
    bench.draw()
    bench.do("record")
    assert "end or discard it before a new scene" in bench.refused("new_scene")
    bench.do("discard_episode")
    bench.do("new_scene")
    assert bench.scenes.made == 1
    held.begin("others")
    held.draw()
    held.do("execute")
    held.refused("new_scene")
    assert held.scenes.made == 0


def test_what_the_simulator_refuses_is_said(bench) -> None:
    bench.begin()
    bench.draw()
    bench.scenes.failure = "no layout was found"
    bench.do("new_scene")
    assert bench.view["instruction"] == "put the red block aside"
    bench.scenes.offered = False
    assert bench.view["scenes"] is False
    assert "no simulator is here" in bench.refused("new_scene")


def test_a_refusal_that_comes_later_is_shown() -> None:
    said: list[str] = []

    class Later:
        def are_offered(self) -> bool:
            return True

        def change(self, on_answer) -> None:
            self.on_answer = on_answer

    class Board:
        refuse = said.append
        lock = contextlib.nullcontext()

    class Recording:
        episode = None

    later = Later()
    changed: list[str] = []
    change = SceneChange(later, Recording(), Board(), changed.append)
    assert change.is_offered and not SceneChange(None, Recording(), Board(), said.append).is_offered
    change.commands["new_scene"]({})
    assert not said and changed == [""]
    later.on_answer(False, "no layout was found")
    assert said == ["there is no new scene: no layout was found"]
