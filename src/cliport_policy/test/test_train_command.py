"""The command line of training: what it writes and shows, how it fails, and several processes that are as one."""

import logging
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from cliport_policy.config import PAPER, RECOLORS, TrainConfig
from cliport_policy.data.mixture import SourceSettings
from cliport_policy.data.mixture_file import SourceEntry
from cliport_policy.errors import ConfigError
from cliport_policy.train import main
from cliport_policy.training.curves import read_curves
from cliport_policy.training.log import ProgressLine
from cliport_policy.training.options import parse_options
from cliport_policy.training.trainer import Progress

SMALL = 0.0125  # m: pixels of 64 x 32 heightmaps
TINY = [
    *("--config", "transporter", "--set", "width=0.0625", "--set", "crop_pixels=32", "--set", "n_rotations=8"),
    *("--set", "train.precision=float32", "--batch", "4", "--phrases", "1", "--device", "cpu"),
]
pytestmark = pytest.mark.usefixtures("one_thread")


def test_a_training_writes_policies_curves_and_pictures(
    make_flat_set: Callable[..., Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.INFO)
    data, val = (make_flat_set(tmp_path / name, 3, actions=2, pixel_size=SMALL, seed=i) for i, name in enumerate("ab"))
    out = tmp_path / "out"
    arguments = ["--data", f"{data}:2", "--data", str(val), "--val", str(val), "--out", str(out), "--keep-steps", "2"]
    assert main([*TINY, "--steps", "4", "--n-demos", "2", *arguments]) == 0
    written = {str(path.relative_to(out)) for path in out.rglob("*.*") if "events" not in str(path)}
    assert written == {
        *("policy.safetensors", "policy.json", "training_state.safetensors", "training_config.json", "samples.png"),
        *("curves.png", "checkpoints/step-0000002.safetensors", "checkpoints/step-0000002.json"),
    }
    events = EventAccumulator(str(out / "events")).Reload()
    assert {"loss/locator", "loss/transport", "learning_rate", "samples_per_s"} <= set(events.Tags()["scalars"])
    assert [event.step for event in events.Images("affordance")] == [4]
    assert [event.step for event in events.Images("samples")] == [0]
    assert [event.step for event in events.Scalars("agreement/place")] == [2, 4]  # at kept steps, and at the end
    shown = capsys.readouterr()
    assert "4/4" in shown.err and "samples/s" in shown.err and "min left" in shown.err
    assert shown.out.count("agreement with --val") == 2
    assert main([*TINY, "--steps", "4", "--n-demos", "2", *arguments]) == 0  # nothing left to do
    again = capsys.readouterr().out
    assert "step 4 of 4" in again and "agreement" not in again  # which was measured at this step
    assert not [record for record in caplog.records if record.name == "tensorboard"]  # of its files
    curves = read_curves(out / "events", last=4)
    assert [point.step for point in curves["loss/locator"]] == [4]
    assert [point.step for point in curves["agreement/place"]] == [2, 4]


def test_two_processes_are_as_one(make_flat_set: Callable[..., Path], tmp_path: Path) -> None:
    """Tolerance 1e-5, for a network without batch norm."""
    data = make_flat_set(tmp_path / "data", 6, pixel_size=SMALL)
    arguments = [*TINY, "--data", str(data), "--steps", "2"]
    assert main([*arguments, "--out", str(tmp_path / "one")]) == 0
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    subprocess.run(
        [*torchrun, "-m", "cliport_policy.train", *arguments, "--out", str(tmp_path / "two")],
        check=True,
        capture_output=True,
        timeout=170,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )
    one, two = (load_file(tmp_path / name / "policy.safetensors") for name in ("one", "two"))
    assert all(torch.allclose(one[name], two[name], atol=1e-5) for name in one)
    curves = []
    for name in ("one", "two"):
        events = EventAccumulator(str(tmp_path / name / "events")).Reload()
        curves.append([events.Scalars(f"loss/{net}")[-1].value for net in ("locator", "transport")])
    assert curves[0] == pytest.approx(curves[1], rel=1e-5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--data", "/nowhere"], "no data set at /nowhere"),
        (["--data", "{data}", "--config", "clipotr"], "did you mean 'cliport'"),
        (["--data", "{data}", "--set", "widht=1"], "did you mean 'widths'"),
        (["--data", "{data}", "--set", "train.jiter=1"], "did you mean 'jitter'"),
        (["--data", "{data}", "--set", "nonsense"], "KEY=VALUE"),
        (["--data", "{data}", "--set", "train.recolor=survey"], "did you mean 'surveyed'"),
        (["--data", "{data}:0"], "weight"),
        (["--data", "{data}", "--n-demos", "99"], "99 were asked for"),
        (["--data", "{data}", "--n-demos", "0"], "--n-demos must be 1 or more"),
        (["--data", "{data}", "--steps", "-1"], "steps=-1"),
        (["--data", "{data}", "--keep-steps", "1k"], "--keep-steps 1k"),
        (["--data", "{data}", "--cache-gb", "inf"], "--cache-gb must be a finite number"),
        (["--data", "{data}", "--cache-gb", "nan"], "--cache-gb must be a finite number"),
        (["--data", "{data}", "--save-minutes", "nan"], "--save-minutes must be a finite number"),
        (["--data", "{data}", "--minutes", "nan"], "--minutes must be a finite number"),
        (["--data", "{data}", "--set", "widths=24"], "widths must hold at least two"),
        (["--data", "{data}", "--data", "{other}"], "other workspaces (pixel_size"),
        (["--data", "{data}", "--val", "{other}"], "other workspaces (pixel_size"),
        (["--data", "{data}", "--config", "image_goal"], "no observation of a finished scene"),
        (["--data", "{data}", "--out", "{data}/meta.json"], "can't write"),
        (["--data", "{data}", "--out", "{taken}"], "can't write {taken}/curves.png"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str],
    message: str,
    make_flat_set: Callable[..., Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folders = {
        "data": make_flat_set(tmp_path / "data", 2, pixel_size=SMALL),
        "other": make_flat_set(tmp_path / "other", 1, pixel_size=2 * SMALL),
    }
    folders["taken"] = tmp_path / "taken"
    (folders["taken"] / "curves.png").mkdir(parents=True)
    given = [argument.format(**folders) for argument in arguments]
    assert main(["--out", str(tmp_path / "out"), "--steps", "1", "--phrases", "0", *given]) == 1
    error = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(error) == 1 and message.format(**folders) in error[0]


def test_a_gpu_that_is_not_here_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    if torch.cuda.is_available():
        pytest.skip("there is a GPU")
    assert main(["--data", "x", "--out", "y", "--device", "cuda"]) == 1
    assert capsys.readouterr().err.startswith("error: no CUDA device is here")


def test_a_mixture_is_one_folder_of_data_sets() -> None:
    options = parse_options(["--data", "ten", "--mixture", "ten", "--out", "o"])
    assert len(options.data) == 10 and options.data[0].folder == Path("ten/put-blocks-in-bowls-seen-colors")
    with pytest.raises(ConfigError, match="needs one --data"):
        parse_options(["--data", "a", "--data", "b", "--mixture", "ten", "--out", "o"])


def test_options_change_a_recipe() -> None:
    options = parse_options(["--data", "a:b:3", "--out", "o"])
    assert options.train == TrainConfig() and options.data == (SourceEntry(Path("a:b"), 3.0, SourceSettings()),)
    paper = parse_options(["--data", "a", "--out", "o", "--optimizer", "paper", "--batch", "8"]).train
    assert paper.batch_size == 8 and paper.targets == PAPER.targets == "one_hot"


def test_progress_is_one_line() -> None:
    line = ProgressLine(sys.stderr).line(Progress(30, 60, {}, 1e-3, 31.25, 2.0))
    assert line.startswith("[############------------] 30/60") and "31.2 samples/s" in line and "2 min left" in line


@pytest.mark.parametrize("recolor", RECOLORS)
def test_recolor_is_set_by_its_name(recolor: str) -> None:
    """YAML takes some words, such as off, for something else."""
    assert parse_options(["--data", "a", "--out", "o", "--set", f"train.recolor={recolor}"]).train.recolor == recolor
