"""Data sets: an index that knows episodes and goals, images read when asked for, one line for what can't be used."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from cliport_core.heightmap import Heightmap
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.errors import DataError

SMALL = 0.0125  # m: pixels of 64 x 32 heightmaps
MakeSet = Callable[..., Path]


def test_an_observation_is_what_was_drawn(flat_set: Path) -> None:
    data = load_demonstrations(flat_set)
    demo = data.frames[0].demos[0]
    seen = data.observation(data.frames[0])
    assert seen.workspace == data.workspace and seen.valid.all()
    assert tuple(seen.color[demo.pick_pixel]) == (255, 87, 89)
    assert seen.height[demo.pick_pixel] == pytest.approx(0.04, abs=1e-4)
    assert seen.height[0, 0] == pytest.approx(0, abs=1e-4)


def test_the_first_episodes_of_each_task(make_flat_set: MakeSet, tmp_path: Path) -> None:
    one = make_flat_set(tmp_path / "set", 5, actions=2, task="a", pixel_size=SMALL)
    two = make_flat_set(tmp_path / "other", 5, actions=3, task="b", pixel_size=SMALL)
    (two / "part-00000.parquet").rename(one / "part-00001.parquet")
    data = load_demonstrations(one).first_episodes(2)
    assert [(f.task, f.episode, f.step) for f in data.frames] == [
        *(("a", episode, step) for episode in range(2) for step in range(3)),
        *(("b", episode, step) for episode in range(2) for step in range(4)),
    ]
    with pytest.raises(DataError, match="has 2 demonstrations of a, 3 were asked for"):
        data.first_episodes(3)


@pytest.mark.parametrize(("task", "goals"), [("stack-block-pyramid-seq-seen", [1, 2, 2]), ("align-rope", [2, 2, 2])])
def test_goals_of_an_episode(task: str, goals: list[int], make_flat_set: MakeSet, tmp_path: Path) -> None:
    data = load_demonstrations(make_flat_set(tmp_path / "set", 2, actions=2, task=task, pixel_size=SMALL))
    found = data.goal_frames()
    assert [data.frames[found[i]].step for i in range(6)] == 2 * goals
    assert all(data.frames[goal].episode == data.frames[i].episode for i, goal in found.items())


@pytest.mark.parametrize(("stepwise", "goals"), [(True, [1, 2, 2]), (False, [2, 2, 2])])
def test_a_data_set_says_itself_whether_a_sentence_is_a_step(
    stepwise: bool, goals: list[int], make_flat_set: MakeSet, tmp_path: Path
) -> None:
    folder = make_flat_set(tmp_path / "set", 1, actions=2, task="my-task", pixel_size=SMALL)
    meta = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps(meta | {"stepwise": stepwise}))
    data = load_demonstrations(folder)
    found = data.goal_frames()
    assert [data.frames[found[i]].step for i in range(3)] == goals


def test_an_unfinished_episode_has_no_goals(make_flat_set: MakeSet, tmp_path: Path) -> None:
    folder = make_flat_set(tmp_path / "set", 2, actions=2, pixel_size=SMALL, finish=False)
    assert load_demonstrations(folder).goal_frames() == {}


def test_memory_is_bounded(flat_set: Path) -> None:
    table = pq.read_table(flat_set / "part-00000.parquet")
    pq.write_table(table, flat_set / "part-00000.parquet", row_group_size=1)
    whole = load_demonstrations(flat_set)
    pictures = [whole.observation(frame).color for frame in whole.frames]
    one_row = whole.rows.cached_bytes / len(whole.frames)
    bounded = load_demonstrations(flat_set, cache_bytes=int(2.5 * one_row))
    for _ in range(2):
        for frame, picture in zip(bounded.frames, pictures, strict=True):
            assert np.array_equal(bounded.observation(frame).color, picture)
            assert bounded.rows.cached_bytes <= 2.5 * one_row


def _read(folder: Path) -> Heightmap:
    data = load_demonstrations(folder)
    return data.observation(data.frames[0])


def _truncate(folder: Path) -> None:
    part = folder / "part-00000.parquet"
    part.write_bytes(part.read_bytes()[:-200])


def _change(name: str, value: object) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        table = pq.read_table(folder / "part-00000.parquet")
        rows = table.to_pylist()
        (rows[0]["demos"][0] if name in rows[0]["demos"][0] else rows[0])[name] = value
        pq.write_table(type(table).from_pylist(rows), folder / "part-00000.parquet")

    return change


def _twice(folder: Path) -> None:
    (folder / "part-00001.parquet").write_bytes((folder / "part-00000.parquet").read_bytes())


def _drop(column: str) -> Callable[[Path], None]:
    def drop(folder: Path) -> None:
        part = folder / "part-00000.parquet"
        pq.write_table(pq.read_table(part).drop_columns([column]), part)

    return drop


def _version(folder: Path) -> None:
    meta = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps({**meta, "version": 77}))


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (_truncate, r"part-00000\.parquet can't be read"),
        (lambda folder: (folder / "part-00000.parquet").unlink(), "holds no demonstrations"),
        (lambda folder: (folder / "meta.json").unlink(), "no data set at"),
        (lambda folder: (folder / "meta.json").write_text("{"), "is not JSON"),
        (lambda folder: (folder / "meta.json").write_text('{"version": 1}'), "no usable workspace"),
        (_version, "version 77, this reader knows 1, 2, 3"),
        (_change("pick_yaw", float("nan")), "a yaw is not a number"),
        (_change("place_row", 999), "outside its workspace"),
        (_change("color_png", b"no png"), "episode 0, step 0 of .* can't be decoded"),
        (_drop("height_png"), "no column height_png"),
        (_twice, "holds episode 0 twice"),
    ],
)
def test_what_cannot_be_used_is_one_line(
    damage: Callable[[Path], None], message: str, make_flat_set: MakeSet, tmp_path: Path
) -> None:
    folder = make_flat_set(tmp_path / "set", 2, pixel_size=SMALL)
    damage(folder)
    with pytest.raises(DataError, match=message) as caught:
        _read(folder)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 500


def test_images_of_another_size_are_refused(make_flat_set: MakeSet, tmp_path: Path) -> None:
    small, large = (make_flat_set(tmp_path / str(size), 1, pixel_size=size) for size in (SMALL, 2 * SMALL))
    (large / "part-00000.parquet").replace(small / "part-00000.parquet")
    data = load_demonstrations(small)
    with pytest.raises(DataError, match="shape"):
        data.observation(data.frames[0])
