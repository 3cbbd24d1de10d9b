"""Data generation: what is written is what was seen, the same again, and continued where it stopped."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cliport_benchmark import generate as module
from cliport_benchmark import generate_cli
from cliport_benchmark.dataset_format import part_path, read_json, read_part
from cliport_benchmark.errors import DataFolderError, OptionError
from cliport_benchmark.generate import GenerateConfig, PartReport, generate, make_part
from cliport_perception import WorkspaceSpec
from sim_bridge.colors import COLORS, SEEN_PALETTE

TASK = "put-blocks-in-bowls-seen-colors"
CONFIG = GenerateConfig(TASK, "train", 0, 2, goals_per_scene=4, randomize=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    make_part(CONFIG, folder, 0)
    return folder


def test_rows_read_back_and_demos_lie_on_what_they_name(folder: Path) -> None:
    workspace = WorkspaceSpec()
    rows = read_part(part_path(folder, 0), workspace)
    assert {row.episode for row in rows} == {0, 1}
    for row in rows:
        own = row.demos[0]
        last = row is rows[-1] or row.step > rows[rows.index(row) + 1].step
        assert own.done == last
        assert own.instruction == f"put the {own.block} blocks in a {own.bowl} bowl"
        assert len({(d.block, d.bowl) for d in row.demos}) == len(row.demos) <= 4
        for demo in row.demos:
            assert demo.block in SEEN_PALETTE and demo.bowl in SEEN_PALETTE
            if demo.done:
                assert demo.pick_row == demo.place_col == -1
                continue
            assert demo.pick_yaw_period == pytest.approx(np.pi / 2)
            color = row.heightmap.color[demo.pick_row - 1 : demo.pick_row + 2, demo.pick_col]
            assert closest(color.mean(axis=0)) == demo.block
            assert row.heightmap.height[demo.pick_row, demo.pick_col] == pytest.approx(0.04, abs=0.012)
            assert 0 < row.heightmap.height[demo.place_row, demo.place_col] < 0.03


def closest(color: np.ndarray) -> str:
    """The palette's colour of the same hue and saturation, whatever the light."""
    unit = color / np.linalg.norm(color)
    return max(SEEN_PALETTE, key=lambda name: float(unit @ np.array(COLORS[name]) / np.linalg.norm(COLORS[name])))


def test_same_settings_make_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    make_part(CONFIG, tmp_path, 0)
    assert part_path(tmp_path, 0).read_bytes() == part_path(folder, 0).read_bytes()


def test_complete_parts_are_kept_and_other_settings_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "EPISODES_PER_PART", 1)
    config = replace(CONFIG, episodes=2)
    reports: list[tuple[PartReport, int]] = []
    part_path(tmp_path / "set", 0).parent.mkdir()
    module._open_folder(config, tmp_path / "set", {"command": "test", "commit": "none"})
    part_path(tmp_path / "set", 0).write_bytes(b"already here")
    part_path(tmp_path / "set", 1).write_bytes(b"already here")
    generate(config, tmp_path / "set", 1, {}, lambda report, left: reports.append((report, left)))
    assert not reports
    assert read_json(tmp_path / "set" / "meta.json")["command"] == "test"
    with pytest.raises(DataFolderError, match="randomize True not False"):
        generate(replace(config, randomize=False), tmp_path / "set", 1, {}, lambda report, left: None)
    with pytest.raises(DataFolderError, match="choose another --out"):
        generate(config, tmp_path, 1, {}, lambda report, left: None)
    with pytest.raises(DataFolderError, match="generate it again"):
        read_part(part_path(tmp_path / "set", 0), WorkspaceSpec())


def test_command_line_makes_only_the_missing_part(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--task", TASK, "--episodes", "2", "--goals-per-scene", "4", "--randomize"]
    arguments += ["--processes", "1", "--out", str(tmp_path / "new")]
    assert generate_cli.main(arguments) == 0
    assert part_path(tmp_path / "new", 0).read_bytes() == part_path(folder, 0).read_bytes()
    meta = read_json(tmp_path / "new" / "meta.json")
    assert meta["task"] == TASK and meta["episodes"] == 2 and "generate --task" in meta["command"]
    assert generate_cli.main(arguments) == 0
    assert "ETA" not in capsys.readouterr().out.split("complete", 1)[1]


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--task", "put-blocks-in-bowls"], "did you mean put-blocks-in-bowls-"),
        (["--split", "trian"], "did you mean train"),
        (["--episodes", "0"], "--episodes must be 1 or more, got 0"),
        (["--first-seed", "-3"], "--first-seed must be 0 or more, got -3"),
        (["--processes", "0"], "--processes must be 1 or more"),
        (["--goals-per-scene", "0"], "--goals-per-scene must be 1 or more"),
        (["--out", "/proc/none"], "cannot write /proc/none"),
    ],
)
def test_bad_input_is_one_clear_line(
    extra: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--task", TASK, "--episodes", "1", "--out", str(tmp_path / "x"), *extra]
    assert generate_cli.main(arguments) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ") and message in error and error.count("\n") == 1


def test_config_refuses_what_makes_no_data_set() -> None:
    with pytest.raises(OptionError):
        GenerateConfig(TASK, "train", 0, -1)
