"""What the page shows and answers, word for word."""

from __future__ import annotations

from typing import Any

import pytest
from station_fakes import BLOCKS, FakeTable

from demo_tool.errors import StationError
from demo_tool.recording import Recorder
from demo_tool.station_config import StationConfig

NOBODY = {"state": "absent", "words": "no policy server has been seen", "proposal": None}


def test_the_view_before_anything_has_come(bench) -> None:
    before = bench.view
    assert before == {
        "state": "waiting_for_camera",
        "words": "No picture has come yet: is the camera running?",
        "instruction": "",
        "history": [],
        "primitive": "pick_place",
        "n_rotations": 36,
        "draft": {"pick": None, "place": None, "source": "clicked"},
        "plan": None,
        "phase": "",
        "progress": 0.0,
        "approval": None,
        "away": False,
        "held_width": None,
        "data_set": None,
        "recorded": 0,
        "covered": {"pick": [], "place": []},
        "episode": None,
        "verdict": None,
        "unsaved": None,
        "data_sets": [],
        "policy": NOBODY,
        "camera": {"width": 0, "height": 0, "age_ms": None, "fps": 0.0},
        "holder": None,
        "last": {"ok": True, "words": ""},
        "scenes": True,
        "lesson": {"state": "none", "data_set": "", "words": "", "share": None, "table": [], "policy": None},
        "calibration": {"state": "none", "words": "", "lines": [], "share": 0.0},
    }


def test_each_step_on_the_way_to_a_motion_is_named(bench) -> None:
    words = []
    bench.see()
    words.append(bench.view["words"])
    for command, arguments in (
        ("open_data_set", {"name": "blocks"}),
        ("instruction", {"text": "put it aside"}),
        ("pick", {"box": bench.table.box_around(BLOCKS[0]), "rotation": 0}),
        ("place", {"box": bench.table.box_at(0.5, -0.28), "rotation": 0}),
    ):
        bench.do(command, **arguments)
        words.append(bench.view["words"])
    assert words == [
        "Ready: open a data set to record in.",
        "Ready: type what the next step is to do.",
        "Ready: draw the pick box.",
        "Ready: draw the place box.",
        "Ready: execute, or only record.",
    ]


@pytest.mark.parametrize(
    ("command", "arguments", "answer"),
    [
        ("instruction", {"text": "put it aside"}, {"words": "the instruction is set"}),
        ("instruction", {"text": ""}, {"words": "the instruction is empty"}),
        ("primitive", {"name": "sweep"}, {"words": "the arm will sweep"}),
        ("primitive", {"name": "pick_place"}, {"words": "the arm will pick and place"}),
        ("clear", {}, {"words": "nothing is drawn"}),
        ("stop", {}, {"ok": True, "words": "stopped: nothing moves until you resume"}),
        ("resume", {}, {"words": "ready again; look where the arm and the objects are"}),
    ],
)
def test_a_command_is_answered(bench, command: str, arguments: dict[str, Any], answer: dict[str, Any]) -> None:
    before = bench.station.changed
    assert bench.do(command, **arguments) == answer
    assert bench.view["last"] == {"ok": True, "words": answer["words"]} and bench.station.changed > before


@pytest.fixture(scope="module")
def view_of_blocks():
    """A view that is drawn once; its stamp is 1 s."""
    return FakeTable().live_view(10**9)


def record(bench, n_steps: int = 1) -> str:
    """Record steps without moving the arm; return the episode's name."""
    bench.begin()
    for _ in range(n_steps):
        bench.draw()
        bench.do("record")
    return bench.view["episode"]["name"]


def test_the_answers_of_an_episodes_life(bench) -> None:
    name = record(bench, 2)
    assert bench.do("mark", success=False) == {"words": "this episode will be recorded as: failure"}
    assert bench.view["verdict"] is False
    again = bench.do("open_data_set", name="blocks")
    assert again == {"words": f"data set 'blocks' is open: 1 episodes; episode {name} goes on after 2 steps"}
    assert bench.view["verdict"] is None
    assert bench.do("end_episode", success=None) == {"words": f"episode {name} is saved: unmarked"}
    shown = {
        "step": 0,
        "instruction": "put the red block aside",
        "primitive": "pick_place",
        "source": "clicked",
        "outcome": "recorded without moving",
        "message": "",
        "frames": 0,
        "frame_ms": 0,
    }
    assert bench.do("episode", name=name) == {
        "name": name,
        "success": None,
        "complaints": [],
        "steps": [shown, {**shown, "step": 1}],
    }
    (info,) = bench.do("episodes")["episodes"]
    assert info.pop("bytes") > 10_000
    assert info == {
        "name": name,
        "n_steps": 2,
        "instructions": ["put the red block aside"],
        "success": None,
        "finished": True,
        "complaints": [],
    }
    for command, arguments, words in (
        ("mark", {"success": True}, f"episode {name}: success"),
        ("relabel", {"name": name, "text": "push it"}, f"episode {name} is relabelled"),
        ("trim", {"name": name, "last": 0}, f"episode {name} is trimmed"),
        ("delete", {"name": name}, f"episode {name} is in the trash"),
        ("restore", {"name": name}, f"episode {name} is back"),
        ("empty_trash", {}, "0 episodes are gone for good; the trash is empty"),
    ):
        assert bench.do(command, **arguments) == {"words": words}
    assert [step["instruction"] for step in bench.do("episode", name=name)["steps"]] == ["push it"]
    assert bench.do("open_data_set", name="blocks") == {"words": "data set 'blocks' is open: 1 episodes"}


def test_an_episode_that_is_thrown_away_takes_its_verdict_along(bench) -> None:
    name = record(bench)
    bench.do("mark", success=True)
    words = f"episode {name} is thrown away; the arm does not go back"
    assert bench.do("discard_episode") == {"words": words}
    assert bench.view["verdict"] is None and bench.view["episode"] is None
    assert "there is no episode to mark: record a step first" in bench.refused("mark", success=True)


def test_arguments_of_edits_have_limits(bench) -> None:
    name = record(bench)
    bench.do("end_episode", success=True)
    pairs = "'parts' must be 1 to 10 pairs of a name and a share, as in [['train', 0.8], ['val', 0.2]]"
    for command, arguments, words in (
        ("trim", {"name": name, "first": 100_001}, "'first' must be 0 to 100000, got 100001"),
        ("trim", {"name": name, "first": -1}, "'first' must be 0 to 100000, got -1"),
        ("split", {"parts": [["a", 1.0]], "seed": 2**31}, "'seed' must be 0 to 2147483647, got 2147483648"),
        ("split", {"parts": [["a", -1_000_001]]}, pairs),
        ("split", {"parts": [[f"p{i}", 0.1] for i in range(11)]}, pairs),
        ("split", {"parts": [[f"p{i}", 1] for i in range(10)]}, "too few"),
        ("split", {"parts": [["a", 1_000_000]]}, "too few"),
        ("mark", {"success": True, "episode": 3}, "'episode' must be a text, got 3"),
    ):
        assert words in bench.refused(command, **arguments)


def test_the_twenty_newest_instructions_are_kept(tmp_path) -> None:
    recorder = Recorder(tmp_path / "sets", 0)
    for number in range(22):
        recorder.remember(f"do {number}")
    recorder.remember("do 5")
    assert recorder.history == ("do 5", *(f"do {number}" for number in range(21, 5, -1)), "do 4", "do 3", "do 2")


def test_data_sets_are_listed_without_hidden_ones(tmp_path) -> None:
    for name in ("b", "a", ".c", "d"):
        (tmp_path / name).mkdir()
        if name != "d":
            (tmp_path / name / "dataset.yaml").write_text("")
    assert Recorder(tmp_path, 0).data_set_names == ("a", "b")


@pytest.mark.parametrize(("free", "refused"), [(63_999_999, True), (64_000_000, False)])
def test_a_step_needs_64_megabytes(bench, monkeypatch, free: int, refused: bool) -> None:
    bench.begin()
    bench.draw()
    monkeypatch.setattr("shutil.disk_usage", lambda _: type("Usage", (), {"free": free}))
    if refused:
        words = "the disk is full: 64 MB are free, 64 MB are needed for a step; empty the trash or make room"
        assert bench.refused("record") == words
    else:
        bench.do("record")
        assert len(bench.steps) == 1


def test_a_picture_of_a_proposal_is_where_its_poses_are(bench) -> None:
    bench.begin()
    bench.do("propose")
    assert bench.last == "the policy has a proposal: correct it, or draw your own"
    proposal = bench.view["policy"]["proposal"]
    for which, pose in (("pick", bench.policy.pick), ("place", bench.policy.place)):
        top, left, bottom, right = bench.table.box_at(pose.x, pose.y)
        row, col = proposal[f"{which}_pixel"]
        assert row == pytest.approx((top + bottom) / 2, abs=0.6) and col == pytest.approx((left + right) / 2, abs=0.6)


def test_ages_are_sent_once_a_second_and_announced_once(bench) -> None:
    bench.see()
    bench.wait(0.01)
    before = bench.station.changed
    changes, words, ages = [], [], []
    for _ in range(60):
        bench.wait(0.1)
        changes.append(bench.station.changed - before)
        ages.append(bench.view["camera"]["age_ms"])
        if bench.view["words"] not in words:
            words.append(bench.view["words"])
    assert changes[:12] == [0] * 9 + [1] * 3 and changes[-1] in (5, 6)
    assert ages[-1] - ages[0] == 5900
    assert words == [
        "Ready: open a data set to record in.",
        "The picture is older than 1 s: is the camera running?",
        "The camera sends no picture: is it running?",
    ]
    before = bench.station.changed - 1
    bench.see()
    assert bench.station.changed == before + 2, "it is fresh again"


def test_the_policys_state_is_shown_with_its_message(bench, view_of_blocks) -> None:
    bench.station.on_policy_gone()
    assert bench.view["policy"] == {"state": "absent", "words": "the policy server is gone", "proposal": None}
    bench.station.on_camera(view_of_blocks)
    assert bench.view["camera"]["age_ms"] == 0
    bench.station.tick(1_500_000_000)
    assert bench.view["camera"]["age_ms"] == 500
    with pytest.raises(StationError, match=r"no command 'secret'; there are color, camera, heightmap, pick_"):
        bench.station.picture("secret", 0, 0.0)


def test_limits_of_a_station() -> None:
    config = StationConfig()
    assert config.crop * config.workspace.pixel_size == pytest.approx(0.08), "the policy's crop is 8 cm wide"
    assert config.box.finger_height == config.box.hand.pad_length
    assert config.home["panda_joint4"] == -2.356 and len(config.home) == 7 and config.home_tolerance == 0.05
