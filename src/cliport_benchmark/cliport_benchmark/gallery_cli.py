"""`ros2 run cliport_benchmark gallery`: one scene of each task on a sheet, and videos of the expert."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from PIL import Image

from cliport_benchmark.agents import ExpertAgent
from cliport_benchmark.arm_hand import ArmHand
from cliport_benchmark.contact_sheet import Captioned, contact_sheet
from cliport_benchmark.episode import run_episode
from cliport_benchmark.errors import BenchmarkError, DataFolderError
from cliport_benchmark.film import Film
from cliport_benchmark.observer import Observer
from cliport_benchmark.stage_camera import StageCamera
from cliport_benchmark.task_names import task_names
from cliport_core.command_line import CommandParser
from sim_bridge.errors import PhysicsError, SimBridgeError
from sim_bridge.scene import reset_scene
from sim_bridge.tasks import make_task
from sim_bridge.world import SimWorld

_PICTURE = (620, 348)
_COLUMNS = 3


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when everything was written, 1 on an error."""
    options = _parser().parse_args(arguments)
    try:
        names = task_names(options.tasks)
        for name in names:
            make_task(name, options.split)  # refuse a wrong name before the work
        _write_sheet(options.out, names, options.split, options.seed)
        if options.videos is not None:
            _make_folder(options.videos)
            for name in names:
                _write_video(options.videos / f"{name}.mp4", name, options.split, options.seed)
    except (BenchmarkError, SimBridgeError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted", file=sys.stderr)
        return 130
    return 0


def _write_sheet(out: Path, names: list[str], split: str, seed: int) -> None:
    """One scene of each task.

    Raises:
        DataFolderError: when the file cannot be written.
    """
    _make_folder(out.parent)
    world, camera, pictures = SimWorld(), StageCamera(*_PICTURE, finer=2), []
    for i, name in enumerate(names, start=1):
        task = reset_scene(world, name, split, seed)
        pictures.append(Captioned(task.name, camera.picture(world), task.instruction))
        print(f"[{i}/{len(names)}] {task.name}: {task.instruction}", flush=True)
    world.close()
    try:
        Image.fromarray(contact_sheet(pictures, _COLUMNS)).save(out, optimize=True)
    except (OSError, ValueError) as error:
        raise DataFolderError(f"cannot write --out {out}: {error}") from error
    print(f"{len(names)} scenes on {out}", flush=True)


def _write_video(path: Path, name: str, split: str, seed: int) -> None:
    """The expert's episode, through the arm; a video of objects that flew apart is left out with a line."""
    start, world = time.monotonic(), SimWorld()
    observer = Observer(world.config)
    try:
        task = reset_scene(world, name, split, seed)
        with Film(path, world, task) as film:
            hand = ArmHand(world, observer, film.on_tick)
            episode = run_episode(world, hand, observer, ExpertAgent(), task, seed, lambda task: task.instruction)
    except PhysicsError as error:
        print(f"{name}: no video, {error}", flush=True)
        return
    finally:
        world.close()
    what = f"score {episode.score:.2f} in {episode.steps} steps, {episode.simulated_s:.0f} s"
    print(f"{name}: {what}; {path} after {time.monotonic() - start:.0f} s", flush=True)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataFolderError(f"cannot make the folder {folder}: {error.strerror or error}") from error


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="gallery", description="Show a scene of each task, and how it is done.")
    parser.add_argument("--out", type=Path, default=Path("docs/benchmark.png"), help="picture to write")
    parser.add_argument("--videos", type=Path, help="folder for a video (MP4) of the expert for each task")
    parser.add_argument("--tasks", default="all", help="names with commas between, all (18 splits) or demo (10 tasks)")
    parser.add_argument("--split", default="test", help="train, val or test")
    parser.add_argument("--seed", type=int, default=0, help="which scene")
    return parser


if __name__ == "__main__":
    sys.exit(main())
