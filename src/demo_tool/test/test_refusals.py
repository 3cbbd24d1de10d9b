"""Bad input gets one line for a person, and nothing moves."""

import shutil

import numpy as np
import pytest
from station_fakes import BLOCKS

from cliport_core.policy_state import PolicyState, ServerStatus
from cliport_core.pose import Pose
from demo_tool.errors import StationError
from demo_tool.station_config import StationConfig


def test_a_box_must_have_a_size_and_be_in_the_picture(bench) -> None:
    bench.begin()
    assert "the box is empty: 0 pixels wide" in bench.refused("pick", box=[10, 20, 30, 20], rotation=0)
    assert "the box is empty" in bench.refused("pick", box=[30, 20, 10, 40], rotation=0)
    assert "reaches out of the picture of 270 rows" in bench.refused("place", box=[250, 20, 280, 40], rotation=0)
    assert "reaches out of the picture" in bench.refused("place", box=[-1, 20, 20, 40], rotation=0)
    assert bench.view["draft"]["pick"] is None and bench.view["draft"]["place"] is None


@pytest.mark.parametrize(
    "box",
    [None, "0 0 9 9", [1, 2, 3], [0, 0, "9", 9], [0, 0, float("nan"), 9], [0, 0, float("inf"), 9], [0, 0, True, 9]],
)
def test_what_is_no_box_is_said(bench, box) -> None:
    bench.begin()
    assert "'box' must be [top, left, bottom, right]" in bench.refused("pick", box=box, rotation=0)


@pytest.mark.parametrize("rotation", [-1, 36, 3.5, "3", None, True, float("nan"), float("inf")])
def test_a_rotation_is_one_of_36(bench, rotation) -> None:
    bench.begin()
    line = bench.refused("pick", box=bench.table.box_around(BLOCKS[0]), rotation=rotation)
    assert "'rotation' must be" in line


def test_a_box_over_holes_in_the_depth_is_kept_and_not_executed(bench) -> None:
    box = bench.table.box_around(BLOCKS[0])
    bench.table.holes = [tuple(box)]
    bench.begin()
    bench.do("place", box=bench.table.box_at(0.5, -0.28), rotation=0)
    answer = bench.do("pick", box=box, rotation=0)
    assert answer["ok"] is False and "knows the depth of 0 of the" in answer["words"]
    drawn = bench.view["draft"]["pick"]
    assert drawn["box"] == box and drawn["grasp"] is None and drawn["words"] == answer["words"]
    for command in ("preview", "execute", "record"):
        assert bench.refused(command) == answer["words"]


def test_a_box_on_the_empty_table_is_not_executed(bench) -> None:
    bench.begin()
    bench.do("place", box=bench.table.box_at(0.5, -0.28), rotation=0)
    answer = bench.do("pick", box=bench.table.box_at(0.5, 0.0), rotation=0)
    assert answer["ok"] is False and "nothing stands in the pick box" in answer["words"]
    assert bench.refused("execute") == answer["words"]
    bench.do("primitive", name="sweep")  # which begins anywhere on the table
    bench.do("execute")
    assert len(bench.arm.goals) == 1


def test_the_object_that_was_taken_away_meanwhile_is_not_grasped(bench) -> None:
    bench.begin()
    bench.draw()
    bench.table.blocks = []
    bench.see()
    assert "nothing stands in the pick box" in bench.refused("execute")


def test_a_place_outside_the_workspace(bench) -> None:
    bench.begin()
    answer = bench.do("place", box=bench.table.box_at(0.72, 0.0), rotation=0)
    assert answer["ok"] is False and "outside the workspace" in answer["words"]


@pytest.mark.parametrize(
    "text", ["setze den Würfel in die grüne Schüssel", "把红色方块放进绿色碗里", "ضع المكعب", "कप में रखो", "🟥 → 🥣"]
)
def test_any_script_will_do(bench, text) -> None:
    bench.do("instruction", text=f"  {text} ")
    assert bench.view["instruction"] == text


def test_instructions_are_short_and_printable(bench) -> None:
    bench.do("instruction", text="put it away")
    assert "10000 characters: at most 500" in bench.refused("instruction", text="a" * 10_000)
    for bad in ("a\x07b", "a\x1b[31mb", "a\u202eb"):
        assert "U+" in bench.refused("instruction", text=bad)
    assert "must be a text" in bench.refused("instruction", text=["a"])
    assert bench.view["instruction"] == "put it away"
    bench.do("instruction", text=" ")
    bench.see()
    bench.do("open_data_set", name="blocks")
    bench.draw()
    assert "type the instruction first" in bench.refused("execute")


@pytest.mark.parametrize("command", ["execute", "record"])
def test_a_step_whose_text_is_refused_leaves_all_as_it_was(bench, command) -> None:
    bench.begin()
    bench.draw()
    assert "U+200B" in bench.refused(command, text="put it\u200bthere")
    assert bench.view["instruction"] == "put the red block aside" and bench.steps == []
    bench.do(command, text="put it there")
    assert bench.view["instruction"] == bench.steps[0]["instruction"] == "put it there"


@pytest.mark.parametrize("command", ["execute", "record", "preview"])
def test_a_step_is_the_one_that_the_page_shows(bench, command) -> None:
    bench.begin()
    bench.draw()
    shown = {
        "primitive": bench.view["primitive"],
        "pick": bench.view["draft"]["pick"],
        "place": bench.view["draft"]["place"],
    }
    seen = {
        name: {k: end[k] for k in ("box", "rotation")} if name in ("pick", "place") else end
        for name, end in shown.items()
    }
    bench.do("pick", box=bench.table.box_around(BLOCKS[1]), rotation=9)  # of another page, or in a tunnel's delay
    for other in (seen, {**seen, "pick": None}, {**seen, "pick": {**seen["pick"], "rotation": 9}}, {}, None, "x"):
        assert "has changed" in bench.refused(command, text="put it elsewhere", draft=other)
    assert bench.view["instruction"] == "put the red block aside" and bench.steps == []
    box = bench.view["draft"]["pick"]["box"]
    assert "has changed" in bench.refused(
        command, draft={**seen, "pick": {"box": box, "rotation": 9}, "primitive": "fold"}
    )
    bench.do(command, draft={**seen, "pick": {"box": box, "rotation": 9}})


def test_a_sweeps_rotations_are_not_the_pages(bench) -> None:
    bench.begin()
    bench.draw()
    bench.do("primitive", name="sweep")
    shown = bench.view["draft"]
    seen = {which: {"box": shown[which]["box"], "rotation": 35} for which in ("pick", "place")}
    bench.do("execute", draft={"primitive": "sweep", **seen})
    assert len(bench.steps) == 1


def test_a_full_disk_is_said_before_anything_moves(make_bench) -> None:
    bench = make_bench(config=StationConfig(min_free=10**18))
    bench.begin()
    bench.draw()
    for command in ("execute", "record"):
        assert "the disk is full" in bench.refused(command)


def test_no_camera(bench) -> None:
    assert bench.state == "waiting_for_camera" and "is the camera running" in bench.view["words"]
    assert "no picture has come yet" in bench.refused("pick", box=[0, 0, 9, 9], rotation=0)
    assert "can be begun once the camera sends pictures" in bench.refused("open_data_set", name="blocks")
    bench.station.on_camera_fault("images come, but nothing on /camera/color/camera_info")
    assert "nothing on /camera/color/camera_info" in bench.view["words"]


def test_an_old_picture_is_not_acted_on(bench) -> None:
    bench.begin()
    bench.draw()
    assert bench.state == "ready"
    bench.wait(0.9)
    assert bench.state == "ready"
    bench.wait(0.2)
    assert bench.state == "stale" and "older than 1 s" in bench.view["words"]
    for command in ("preview", "execute", "record", "propose"):
        assert "older than 1 s" in bench.refused(command)
    bench.wait(4.0)
    assert "The camera sends no picture" in bench.view["words"]
    bench.see(age=2.0)
    assert bench.state == "stale" and "older than 1 s" in bench.view["words"]
    bench.see(age=-5.0)
    assert "use_sim_time" in bench.view["words"]
    bench.see()
    assert bench.state == "ready"


def test_an_executor_that_is_not_there(bench) -> None:
    bench.begin()
    bench.draw()
    bench.arm.fault_words = "the executor is not there: is it running?"
    for command in ("preview", "execute"):
        assert bench.refused(command) == bench.arm.fault_words
    assert bench.do("record")["words"] == "recorded without moving the arm"


def test_a_busy_arm(held) -> None:
    held.begin()
    held.draw()
    held.do("execute")
    for command in ("execute", "preview", "record", "undo", "clear", "propose", "end_episode", "discard_episode"):
        assert "busy planning" in held.refused(command)
    assert "busy" in held.refused("pick", box=held.table.box_around(BLOCKS[0]), rotation=0)
    held.do("instruction", text="the next one already")


def test_a_policy_that_moves_the_arm_is_not_disturbed(bench) -> None:
    bench.begin()
    bench.draw()
    bench.station.on_policy_status(ServerStatus(PolicyState.EXECUTING, "step 1: CARRY", "something else"))
    for command in ("execute", "preview", "propose"):
        assert "the policy server is moving the arm" in bench.refused(command)


def test_a_data_set_of_another_setup_is_refused_in_words(bench) -> None:
    bench.begin()
    bench.draw()
    bench.do("record")
    bench.do("end_episode", success=True)
    moved = bench.table.camera_in_base
    bench.table.camera_in_base = Pose(moved.rotation, moved.translation + np.array([0.012, 0.0, 0.0]))
    bench.see()
    assert "stands 12 mm elsewhere" in bench.refused("open_data_set", name="blocks")
    bench.draw()
    assert "stands 12 mm elsewhere" in bench.refused("execute")  # moved while the data set was open
    bench.table.width, bench.table.height = 160, 90
    bench.see()
    assert "160x90 pixels" in bench.refused("open_data_set", name="blocks")
    assert "not in the picture any more" in bench.refused("execute")


@pytest.mark.parametrize("name", ["", "..", "a/b", ".hidden", "a\\b", "x" * 200, "nul\0", "/etc"])
def test_names_stay_within_the_folder_of_data_sets(bench, name) -> None:
    bench.see()
    assert "name" in bench.refused("open_data_set", name=name)
    assert not any(bench.root.iterdir())


def test_no_picture_comes_from_outside_the_folder_of_data_sets(make_bench, tmp_path) -> None:
    """The folder's parent is a data set here: a name must not lead to it."""
    outside = make_bench(root=tmp_path)
    outside.begin("blocks")
    outside.draw()
    outside.do("record")
    name = outside.view["episode"]["name"]
    outside.do("end_episode", success=True)
    assert outside.station.episode_picture(name, 0, "blocks").any()
    within = make_bench(root=tmp_path / "blocks" / "sets")
    for data_set in ("..", "../../blocks", str(tmp_path / "blocks")):
        with pytest.raises(StationError, match="data set name"):
            within.station.episode_picture(name, 0, data_set)


def test_what_cannot_be_merged_or_split(bench) -> None:
    assert "open a data set first" in bench.refused("merge", other="more")
    bench.begin()
    bench.draw()
    bench.do("record")
    for name in ("", "..", "../blocks", "/etc", ".hidden"):
        assert "name" in bench.refused("merge", other=name)
        assert "episode is being recorded" in bench.refused("split", parts=[["train", 1.0]])
    bench.do("end_episode", success=True)
    assert "merged with itself" in bench.refused("merge", other="blocks")
    assert "is no data set" in bench.refused("merge", other="absent")
    assert "'other' must be a text" in bench.refused("merge", other=None)
    for nothing in (None, [], {}, "train=1", [["train"]], [["train", "1"]], [["a", True]], [["a", float("nan")]],
                    [["a", 10**400]], [[f"part{i}", 1] for i in range(11)]):  # fmt: skip
        assert "'parts' must be 1 to 10 pairs" in bench.refused("split", parts=nothing)
    for name in ("", "../x", "a/b", ".x"):
        assert "part name" in bench.refused("split", parts=[[name, 1.0]])
    assert "two parts have the name 'a'" in bench.refused("split", parts=[["a", 0.5], ["a", 0.5]])
    assert "shares that sum to 1" in bench.refused("split", parts=[["a", 0.9], ["b", 0.9]])
    assert "shares that sum to 1" in bench.refused("split", parts=[["a", 0]])
    assert "too few" in bench.refused("split", parts=[["a", 0.5], ["b", 0.5]])
    assert "'seed' must be" in bench.refused("split", parts=[["a", 1.0]], seed=-1)
    bench.do("split", parts=[["a", 1.0]])
    assert "'blocks_a' exists" in bench.refused("split", parts=[["a", 1.0]])
    assert sorted(path.name for path in bench.root.iterdir()) == ["blocks", "blocks_a"]


def test_a_data_set_of_another_camera_is_not_merged(bench) -> None:
    bench.begin("moved")
    pose = bench.table.camera_in_base
    bench.table.camera_in_base = Pose(pose.rotation, pose.translation + np.array([0.012, 0.0, 0.0]))
    bench.see()
    bench.do("open_data_set", name="blocks")
    assert "stands 12 mm elsewhere" in bench.refused("merge", other="moved")


def test_a_folder_that_cannot_be(make_bench, tmp_path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StationError, match="data sets cannot be kept in"):
        make_bench(root=tmp_path / "file" / "sets")


def test_unknown_commands_and_pictures(bench) -> None:
    assert "there is no command 'rm'; there are" in bench.refused("rm")
    assert "one of pick_place, sweep, fold" in bench.refused("primitive", name="throw")
    with pytest.raises(StationError, match="color"):
        bench.station.picture("secret", 0, 0.0)
    assert "success" in bench.refused("mark", success="yes")
    assert "nothing to undo" in bench.refused("undo")
    assert "open a data set first" in bench.refused("episodes")
    bench.see()
    bench.do("instruction", text="put it away")
    bench.draw()
    assert "open a data set first" in bench.refused("execute")
    assert "no proposal" in bench.refused("correct")


def test_a_data_set_that_vanished(bench) -> None:
    bench.begin()
    bench.draw()
    shutil.rmtree(bench.root / "blocks")
    assert bench.refused("execute")
