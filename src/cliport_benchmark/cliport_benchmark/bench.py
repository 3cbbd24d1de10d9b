"""`make bench`: how long the pieces take on this machine, as a table and as out/bench.json."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from importlib import metadata
from pathlib import Path
from statistics import median

import numpy as np

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.provenance import machine

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
    """Milliseconds of wall time a call."""
    for _ in range(warmup):
        call()
    samples = []
    for _ in range(n):
        start = time.perf_counter()
        call()
        samples.append(1000 * (time.perf_counter() - start))
    return row(name, samples, "ms")


def row(name: str, samples: list[float], unit: str) -> Row:
    return Row(name, round(median(samples), 2), round(min(samples), 2), round(max(samples), 2), unit, len(samples))


def bench_camera_and_action() -> list[Row]:
    """Rendering frames, projecting one, and one action of the shipped policy with 36 rotations.

    render_*: one window of the image on one thread, as data is generated, of a scene that stays and of ever new looks.
    """
    from cliport_benchmark.observer import Observer
    from cliport_perception.heightmap_builder import HeightmapBuilder
    from cliport_policy import load_policy
    from sim_bridge.rendering.camera import CameraConfig, SimCamera
    from sim_bridge.rendering.sensor_noise import NoiseConfig
    from sim_bridge.world import SimConfig, SimWorld

    world = SimWorld(SimConfig())
    task = world.reset(TASK, "test", 0)
    camera = SimCamera()
    rng = np.random.default_rng(0)
    frame = camera.capture(world, rng)
    builder = HeightmapBuilder(camera.intrinsics, camera.camera_in_base, world.config.workspace)
    heightmap = builder.build(frame.color, frame.depth)
    policy = load_policy("default")
    perfect = SimCamera(CameraConfig(noise=NoiseConfig.none()))
    still, changing = (Observer(world.config, n_threads=1, randomize=randomize) for randomize in (False, True))

    def new_look() -> None:
        changing.new_scene(rng)
        changing.frame(world)

    rows = [
        timed("action_compact", lambda: policy.infer(heightmap, task.instruction), 30),
        timed("heightmap_960x540", lambda: builder.build(frame.color, frame.depth), 50),
        timed("render_960x540", lambda: camera.capture(world, rng), 30),
        timed("render_960x540_no_noise", lambda: perfect.capture(world, rng), 30),
        timed("render_window", lambda: still.frame(world), 30),
        timed("render_window_new_look", new_look, 30),
    ]
    world.close()
    return rows


def bench_planning() -> list[Row]:
    """All motions of one pick and place, planned from the ready pose in scenes of the task."""
    from cliport_benchmark.observer import Observer
    from panda_executor.model import PandaModel
    from panda_executor.request import PickPlaceRequest
    from panda_executor.transfer import TransferPlanner
    from sim_bridge.world import SimConfig, SimWorld

    sim = SimConfig()
    world, observer, planner = SimWorld(sim), Observer(sim), TransferPlanner(PandaModel())
    samples = []
    for seed in range(20):
        task = world.reset(TASK, "val", seed)
        action = task.expert_action()
        if action is None:
            continue
        cloud = observer.cloud(observer.frame(world))
        request = PickPlaceRequest(action.pick, action.place)
        start = time.perf_counter()
        planner.plan(request, cloud, sim.workspace, planner.ready)
        samples.append(1000 * (time.perf_counter() - start))
    world.close()
    return [row("plan_transfer", samples, "ms")]


def bench_training() -> list[Row]:
    """One training sample of the compact network, forward and backward, in batches of 16 of random data."""
    import torch

    from cliport_policy.batches import Batch
    from cliport_policy.config import NetworkConfig, TrainConfig
    from cliport_policy.losses import compute_losses
    from cliport_policy.networks.compact import CompactNetwork

    config = TrainConfig()
    size = config.batch_size
    generator = torch.Generator().manual_seed(0)
    network = CompactNetwork(NetworkConfig()).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    pixels = torch.rand(size, 2, generator=generator) * torch.tensor([319.0, 159.0])
    batch = Batch(
        torch.randn(size, 5, 320, 160, generator=generator), [TASK] * size,
        torch.zeros(size, dtype=torch.bool), pixels, torch.zeros(size), torch.full((size,), np.pi / 2),
        pixels.flip(0), torch.zeros(size),
    )  # fmt: skip

    def step() -> None:
        with torch.autocast("cpu", torch.bfloat16):
            losses = compute_losses(network, batch, config, generator)
        losses.total().backward()

    batches = timed("train_sample_compact", step, 8, warmup=2)
    scaled = {name: round(getattr(batches, name) / size, 2) for name in ("median", "min", "max")}
    return [replace(batches, **scaled)]


def bench_first_motion(n: int = 5) -> list[Row]:
    """From publishing an instruction to the arm's first motion, in the running graph."""
    from cliport_benchmark.graph_client import GraphClient
    from cliport_benchmark.graph_process import GraphProcess

    samples = []
    with tempfile.TemporaryDirectory() as folder:
        arguments = {"task": TASK, "split": "val", "seed": "0"}
        with (
            GraphProcess("sim.launch.yaml", arguments, Path(folder) / "log") as graph,
            GraphClient("bench") as client,
        ):
            client.wait_ready(120.0, lambda: graph.healthy)
            for seed in range(n):
                sentence = client.reset(TASK, "val", seed)
                time.sleep(1.0)
                samples.append(client.seconds_to_motion(sentence, 20.0))
                client.instruct("")
                client.wait_at_rest(20.0)
    return [row("first_motion", samples, "s")]


def bench_generation() -> Iterator[Row]:
    """Episodes a minute of the fast generator, and how many times the public implementation's that is."""
    from cliport_benchmark.bench_generation import PUBLIC_SECONDS, episodes_a_minute

    for task, seconds in PUBLIC_SECONDS.items():
        rates = episodes_a_minute(task)
        yield row(f"generate_fast_{task}", rates, "/min")
        yield row(f"generate_fast_{task}_ratio", [rate * seconds / 60.0 for rate in rates], "x")


BENCHES: dict[str, Callable[[], Iterable[Row]]] = {
    "camera_and_action": bench_camera_and_action,
    "planning": bench_planning,
    "training": bench_training,
    "first_motion": bench_first_motion,
    "generation": bench_generation,
}
ON_REQUEST = ("generation",)  # minutes each: not part of `make bench`


def versions() -> dict[str, str]:
    """Of the packages that the figures depend on."""
    return {name: metadata.version(name) for name in PACKAGES}


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="bench", description="Time the pieces on this machine.")
    parser.add_argument("--group", choices=sorted(BENCHES), help=f"one instead of all but {', '.join(ON_REQUEST)}")
    parser.add_argument("--out", default="out/bench.json")
    args = parser.parse_args(argv)
    rows: list[Row] = []
    print(f"{'name':56}{'median':>10}{'min':>10}{'max':>10}  unit     n", flush=True)
    try:
        for name, bench in BENCHES.items():
            if name != args.group and (args.group or name in ON_REQUEST):
                continue
            for r in bench():
                rows.append(r)
                print(f"{r.name:56}{r.median:10.2f}{r.min:10.2f}{r.max:10.2f}  {r.unit:4}{r.n:6}", flush=True)
    except BenchmarkError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    out = Path(args.out)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(
        json.dumps({"machine": machine(), "versions": versions(), "rows": [asdict(r) for r in rows]}, indent=2) + "\n"
    )
    print(f"written to {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
