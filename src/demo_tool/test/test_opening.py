"""Opening of a data set and its unfinished episode: as a whole, or what was open before stays so."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from station_fakes import BLOCKS

from cliport_episodes.errors import DiskFullError
from cliport_episodes.writer import EpisodeWriter


def test_a_data_set_that_cannot_be_opened_leaves_the_other_open(bench, make_bench, monkeypatch) -> None:
    other = make_bench()
    other.begin("other")
    other.draw()
    other.do("record")
    other.station.close()
    bench.begin()
    bench.draw()
    bench.do("record")
    bench.do("mark", success=True)
    before = bench.view

    def full(*_) -> EpisodeWriter:
        raise DiskFullError(bench.root, "no space is left", "Make room.")

    monkeypatch.setattr(EpisodeWriter, "resume", full)
    assert "no space is left" in bench.refused("open_data_set", name="other")
    kept = ("data_set", "episode", "verdict", "history")
    assert {key: bench.view[key] for key in kept} == {key: before[key] for key in kept}
    monkeypatch.undo()
    bench.draw()
    bench.do("record")
    assert len(bench.steps) == 2


@pytest.mark.parametrize("undone", [False, True])
def test_opening_the_open_data_set_again_keeps_its_episode(bench, undone) -> None:
    bench.begin()
    for _ in range(2):
        bench.draw()
        bench.do("record")
    if undone:
        bench.do("undo")
    before = bench.view["episode"]
    words = bench.do("open_data_set", name="blocks")["words"]
    assert f"goes on after {len(before['steps'])} steps" in words and bench.view["episode"] == before
    bench.do("undo")
    assert len(bench.steps) == len(before["steps"]) - 1


def test_any_episode_of_the_data_set_can_go_on(bench) -> None:
    assert "open a data set first" in bench.refused("continue_episode", name="a")
    bench.begin()
    for _ in range(2):
        bench.draw()
        bench.do("record")
    first = bench.view["episode"]["name"]
    bench.do("end_episode", success=True)
    bench.draw()
    bench.do("record")
    second = bench.view["episode"]["name"]
    assert f"episode {first} goes on after 2 steps" in bench.do("continue_episode", name=first)["words"]
    assert bench.view["episode"]["name"] == first and len(bench.steps) == 2
    assert "is open already" in bench.do("continue_episode", name=first)["words"]
    bench.draw()
    bench.do("record")
    assert len(bench.steps) == 3
    assert "there is no episode" in bench.refused("continue_episode", name="absent")
    assert bench.view["episode"]["name"] == first, "what was open stays open"
    bench.do("end_episode", success=True)
    assert [(info["name"], info["n_steps"], info["finished"]) for info in bench.do("episodes")["episodes"]] == sorted(
        [(first, 3, True), (second, 1, False)]
    )


def test_a_data_set_that_lost_its_file_is_offered_and_opened(bench) -> None:
    bench.begin()
    bench.draw()
    bench.do("record")
    bench.station.close()
    (bench.root / "blocks/dataset.yaml").unlink()
    bench.begin("other")
    assert bench.view["data_sets"] == ["blocks", "other"]
    assert "goes on after 1 steps" in bench.do("open_data_set", name="blocks")["words"]


KILLED = """
import os, signal, sys
from pathlib import Path
from cliport_core.pose import PlanarPose
from station_fakes import BLOCKS, FakeArm, FakePolicy, FakeTable
from demo_tool.station import Station
from demo_tool.station_config import StationConfig

table, pose = FakeTable(), PlanarPose(0.42, -0.12, 0.0)
station = Station(StationConfig(), FakeArm(), FakePolicy(pose, pose), Path(sys.argv[1]), run=lambda job: job())
station.on_camera(table.live_view(10**9))
for name, arguments in (
    ("open_data_set", {"name": "blocks"}),
    ("instruction", {"text": "put the red block aside"}),
    ("pick", {"box": table.box_around(BLOCKS[0]), "rotation": 0}),
    ("place", {"box": table.box_at(0.5, -0.28), "rotation": 0}),
    ("execute", {}),
):
    station.command(name, arguments)
print(station.view(None)["episode"]["name"], flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_station_goes_on_with_the_episode_of_one_that_was_killed(bench) -> None:
    killed = subprocess.run(
        [sys.executable, "-c", KILLED, str(bench.root)], capture_output=True, text=True, cwd=Path(__file__).parent
    )
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    bench.see()
    assert "goes on after 1 steps" in bench.do("open_data_set", name="blocks")["words"]
    assert bench.view["episode"]["name"] == killed.stdout.strip() and len(bench.steps) == 1
    assert bench.view["history"] == ["put the red block aside"]
    bench.do("instruction", text="and now the blue one")
    bench.draw(BLOCKS[1])
    bench.do("execute")
    bench.rest()
    bench.do("end_episode", success=True)
    texts = [step.record.instruction for step in bench.episode().steps]
    assert texts == ["put the red block aside", "and now the blue one"]


def test_two_stations_do_not_write_one_episode(bench, make_bench) -> None:
    bench.begin()
    bench.draw()
    bench.do("record")
    other = make_bench()
    other.see()
    assert "cannot go on" in other.do("open_data_set", name="blocks")["words"]
    assert other.view["episode"] is None
    bench.station.close()
    assert "goes on after 1 steps" in other.do("open_data_set", name="blocks")["words"]


def test_finished_episodes_are_counted(bench) -> None:
    assert bench.view["recorded"] == 0
    bench.begin()
    for count in (1, 2):
        bench.draw()
        bench.do("record")
        assert bench.view["recorded"] == count - 1, "one that goes on does not count"
        bench.rest()
        bench.do("end_episode")
        assert bench.view["recorded"] == count
    pick, place = bench.view["covered"]["pick"], bench.view["covered"]["place"]
    assert len(pick) == len(place) == 2 and pick[0] == pick[1] != place[0]
    top, left, bottom, right = bench.table.box_around(BLOCKS[0])
    assert pick[0] == [(top + bottom) // 2, (left + right) // 2]
    first = bench.do("episodes")["episodes"][0]["name"]
    bench.do("delete", name=first)
    assert len(bench.view["covered"]["pick"]) == 1
    assert bench.view["recorded"] == 1
    bench.do("restore", name=first)
    assert bench.view["recorded"] == 2
    bench.do("open_data_set", name="others")
    assert bench.view["recorded"] == 0
    bench.do("merge", other="blocks")
    assert bench.view["recorded"] == 2
