"""`make bench`: how long the pieces take on this machine, as a table and as out/bench.json."""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from importlib import metadata
from itertools import pairwise
from pathlib import Path
from statistics import median

import numpy as np

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.provenance import machine, machine_line
from cliport_core.command_line import CommandParser

TASK = "put-blocks-in-bowls-seen-colors"
PACKAGES = ("torch", "numpy", "opencv-python-headless", "open3d", "pybullet", "ompl", "pin")


@dataclass(frozen=True)
class Row:
    """One figure: n samples of one thing, after a warm-up, in unit."""

    name: str
    median: float
    min: float
    max: float
    unit: str
    n: int


def timed(name: str, call: Callable[[], object], n: int, warmup: int = 3) -> Row:
    """Time calls of a function; return milliseconds of wall time a call."""
    for _ in range(warmup):
        call()
    samples = []
    for _ in range(n):
        start = time.perf_counter()
        call()
        samples.append(1000 * (time.perf_counter() - start))
    return row(name, samples, "ms")


def row(name: str, samples: list[float], unit: str) -> Row:
    """Return a row with median, least and largest of the samples."""
    return Row(name, round(median(samples), 2), round(min(samples), 2), round(max(samples), 2), unit, len(samples))


def bench_camera_and_action() -> list[Row]:
    """Time rendering frames, projecting one, and one action of the shipped policy with 36 rotations.

    render_*: one window of the image on one thread, as data is generated, of a scene that stays and of ever new looks.
    """
    from cliport_benchmark.bench_perception import frame_calls
    from cliport_benchmark.observer import Observer
    from cliport_benchmark.variation import Variation
    from cliport_perception.heightmap_builder import HeightmapBuilder
    from cliport_policy import load_policy
    from sim_bridge.rendering.camera import CameraConfig, SimCamera
    from sim_bridge.rendering.sensor_noise import NoiseConfig
    from sim_bridge.scene import reset_scene
    from sim_bridge.world import SimConfig, SimWorld

    world = SimWorld(SimConfig())
    task = reset_scene(world, TASK, "test", 0)
    camera = SimCamera()
    rng = np.random.default_rng(0)
    frame = camera.capture(world, rng)
    builder = HeightmapBuilder(camera.intrinsics, camera.camera_in_base, world.config.workspace)
    heightmap = builder.build(frame.color, frame.depth)
    policy = load_policy("default")
    perfect = SimCamera(CameraConfig(noise=NoiseConfig.none()))
    still = Observer(world.config, n_threads=1)
    changing = Observer(world.config, n_threads=1, variation=Variation.parse("light,mounting"))

    def new_look() -> None:
        changing.new_scene(rng)
        changing.frame(world)

    rows = [
        timed("action_default", lambda: policy.infer(heightmap, task.instruction), 30),
        *(timed(*call) for call in frame_calls(frame, builder)),
        timed("render_960x540", lambda: camera.capture(world, rng), 30),
        timed("render_960x540_no_noise", lambda: perfect.capture(world, rng), 30),
        timed("render_window", lambda: still.frame(world), 30),
        timed("render_window_new_look", new_look, 30),
    ]
    world.close()
    return rows


def bench_planning() -> Iterator[Row]:
    """Time planning one pick and place of the task from the ready pose, its preview, and single searches.

    plan_preview: trajectory, ways and picture of it, without their messages. search_clutter_*: from one side of the
    workspace to the other, where no straight way is free; *_found: how many of these searches found a way.
    """
    from cliport_benchmark.bench_planning import compared, drawn
    from cliport_benchmark.observer import Observer
    from cliport_core import PickPlaceAction
    from panda_executor.errors import ExecutorError
    from panda_executor.model import PandaModel
    from panda_executor.transfer import TransferPlanner
    from sim_bridge.scene import reset_scene
    from sim_bridge.world import SimConfig, SimWorld

    sim = SimConfig()
    world, observer, planner = SimWorld(sim), Observer(sim), TransferPlanner(PandaModel())
    planner.place_cameras(observer.camera.camera_in_base.translation)
    samples, previews, refused = [], [], []
    for seed in range(20):
        task = reset_scene(world, TASK, "val", seed)
        action = task.expert_action()
        if action is None:
            continue
        cloud = observer.cloud(observer.frame(world))
        asked = PickPlaceAction(action.pick, action.place)
        start = time.perf_counter()
        try:
            plan = planner.plan(asked, cloud, sim.workspace, planner.ready)
        except ExecutorError as error:
            refused.append(f"scene {seed}: {error}")
            continue
        planned = time.perf_counter()
        drawn(planner, plan)
        samples.append(1000 * (planned - start))
        previews.append(1000 * (time.perf_counter() - planned))
    world.close()
    if samples:
        yield row("plan_transfer", samples, "ms")
        yield row("plan_preview", previews, "ms")
    for name, times, share in compared(20):
        yield row(f"search_clutter_{name}", times, "ms")
        yield row(f"search_clutter_{name}_found", [share], "%")
    if refused:
        raise BenchmarkError(f"plan_transfer has {len(samples)} times; {refused[0]}")


def bench_training() -> Iterator[Row]:
    """Time a sample of training the compact network, data and all, and of the loader alone, on rendered scenes.

    train_sample_compact: as training is by default, 4 of the place's 36 rotations and 12 of the rotator's in a sample's
    softmax; train_sample_compact_all: all 36 of both.
    """
    from cliport_benchmark.generate import GenerateConfig, make_part
    from cliport_benchmark.json_files import write_json
    from cliport_policy.config import NetworkConfig, TrainConfig
    from cliport_policy.data.demonstrations import load_demonstrations
    from cliport_policy.data.mixture import Source
    from cliport_policy.language import shared_encoder
    from cliport_policy.training.allocator import keep_freed_memory
    from cliport_policy.training.trainer import Trainer

    keep_freed_memory()
    with tempfile.TemporaryDirectory() as name:
        folder, scenes = Path(name), GenerateConfig(TASK, "train", 0, 12)
        write_json(folder / "meta.json", scenes.settings())
        make_part(scenes, folder, 0)
        sources = [Source(load_demonstrations(folder))]
        every = TrainConfig(steps=8, phrases_per_goal=3, rotator_rotations=0, transport_rotations=0)
        for label, config in (("", TrainConfig(steps=16, phrases_per_goal=3)), ("_all", every)):
            trainer = Trainer(sources, folder / f"out{label}", NetworkConfig(), config, shared_encoder(), {})
            ends: list[float] = []
            trainer.run(lambda _, ends=ends: ends.append(time.perf_counter()))  # type: ignore[misc]
            yield row(f"train_sample_compact{label}", _ms_between(ends[2:], config.batch_size), "ms")
        ends = []
        for _, _step in zip(range(69), trainer.loader.steps(0), strict=False):
            ends.append(time.perf_counter())
        yield row("load_sample", _ms_between(ends[4::8], 8 * config.batch_size), "ms")  # steps come in bursts


def _ms_between(ends: list[float], size: int) -> list[float]:
    """Return milliseconds a sample, when `size` samples ended at each of these seconds."""
    return [1000 * (b - a) / size for a, b in pairwise(ends)]


def bench_first_motion(n: int = 5) -> Iterator[Row]:
    """Time from publishing an instruction to the arm's first motion, in the running graph."""
    from cliport_benchmark.bench_motion import first_motions

    samples, failures = first_motions(TASK, n)
    if samples:
        yield row("first_motion", samples, "s")
    if failures:
        raise BenchmarkError(f"first_motion has {len(samples)} of {n} times; {failures[0]}")


def bench_generation() -> Iterator[Row]:
    """Measure episodes a minute of the fast generator, and how many times the public implementation's that is."""
    from cliport_benchmark.bench_generation import PUBLIC_SECONDS, episodes_a_minute

    for task, seconds in PUBLIC_SECONDS.items():
        rates = episodes_a_minute(task)
        yield row(f"generate_fast_{task}", rates, "/min")
        yield row(f"generate_fast_{task}_ratio", [rate * seconds / 60.0 for rate in rates], "x")


def bench_inference() -> Iterator[Row]:
    """Measure the memory of a process that acts, and each trick beside the plain computation."""
    from cliport_benchmark.bench_inference import footprint, tricks

    found = footprint("default")
    yield row("load_default", found["loading"], "s")
    yield row("resident_default", found["resident"], "MB")
    yield row("highest_default", found["highest"], "MB")
    for name, call in tricks():
        yield timed(name, call, 10)


def bench_paper_size() -> Iterator[Row]:
    """Measure the `cliport` network at full size with random weights: one action, and the memory of its process."""
    from cliport_benchmark.bench_inference import paper_size_footprint

    found = paper_size_footprint()
    yield row("load_cliport", found["loading"], "s")
    yield row("action_cliport", found["actions"], "ms")
    yield row("resident_cliport", found["resident"], "MB")
    yield row("highest_cliport", found["highest"], "MB")


def bench_page() -> Iterator[Row]:
    """Measure the demonstration page on the running graph: the age of its picture, its share of a core, and leaks."""
    from cliport_benchmark.bench_page import page_figures

    for name, found in page_figures(TASK):
        if name == "latency":
            yield row("page_latency_960x540", found, "ms")
            yield row("page_latency_960x540_p95", [float(np.percentile(found, 95))], "ms")
        else:
            yield row(f"page_{name}", found, "cores" if name == "cpu_cores" else "MB")


def bench_perception_node() -> Iterator[Row]:
    """Measure the perception node, on one core, of 960x540 frames that come at 10 Hz."""
    from cliport_benchmark.bench_perception_node import node_figures

    found = node_figures(TASK)
    yield row("perception_node_rate", found["rate"], "Hz")
    for name in ("heightmap", "cloud"):
        yield row(f"perception_node_{name}_age", found[name], "ms")
        yield row(f"perception_node_{name}_age_p95", [float(np.percentile(found[name], 95))], "ms")
    yield row("perception_node_cpu_cores", found["cores"], "cores")


BENCHES: dict[str, Callable[[], Iterable[Row]]] = {
    "camera_and_action": bench_camera_and_action,
    "planning": bench_planning,
    "training": bench_training,
    "first_motion": bench_first_motion,
    "page": bench_page,
    "perception_node": bench_perception_node,
    "inference": bench_inference,
    "paper_size": bench_paper_size,
    "generation": bench_generation,
}
ON_REQUEST = ("paper_size", "generation")  # minutes each: not part of `make bench`


def versions() -> dict[str, str]:
    """Return the versions of the packages that the figures depend on."""
    return {name: metadata.version(name) for name in PACKAGES}


def main(argv: list[str] | None = None) -> int:
    """Run the benchmarks; return 0 when all of them ran, 1 when one failed, 130 when interrupted."""
    parser = CommandParser(prog="bench", description="Time the pieces on this machine.")
    parser.add_argument("--group", choices=sorted(BENCHES), help=f"one instead of all but {', '.join(ON_REQUEST)}")
    parser.add_argument("--out", default="out/bench.json")
    args = parser.parse_args(argv)
    rows: list[Row] = []
    out = Path(args.out)
    out.parent.mkdir(parents=True, exist_ok=True)
    print(machine_line())
    try:
        return _measure(args.group, rows)
    finally:
        said = {"machine": machine(), "versions": versions(), "rows": [asdict(r) for r in rows]}
        out.write_text(json.dumps(said, indent=2) + "\n")
        print(f"written to {out}")


def _measure(group: str | None, rows: list[Row]) -> int:
    """Add the rows of one group or of all to a list, print them as they come, and return the exit status."""
    status = 0
    print(f"{'name':56}{'median':>10}{'min':>10}{'max':>10}  unit     n", flush=True)
    for name, bench in BENCHES.items():
        if name != group and (group or name in ON_REQUEST):
            continue
        try:
            for r in bench():
                rows.append(r)
                print(f"{r.name:56}{r.median:10.2f}{r.min:10.2f}{r.max:10.2f}  {r.unit:5}{r.n:5}", flush=True)
        except BenchmarkError as error:
            status = 1
            print(f"error: {error}", file=sys.stderr)
        except KeyboardInterrupt:
            print("error: interrupted", file=sys.stderr)
            return 130
    return status


if __name__ == "__main__":
    sys.exit(main())
