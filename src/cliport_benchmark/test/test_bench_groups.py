"""What each group of `make bench` measures and how often, with everything that takes time played."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from cliport_benchmark import bench, bench_motion
from cliport_benchmark.errors import BenchmarkError
from cliport_core import PickPlaceAction, PlanarPose
from panda_executor.errors import ExecutorError

POSE = PlanarPose(0.4, 0.0, 0.0)


class Anything:
    """Has everything, does nothing, and counts its calls by name."""

    calls: list[str]

    def __init__(self, name: str, calls: list[str]) -> None:
        self._name, self.calls = name, calls

    def __getattr__(self, name: str) -> Anything:
        return Anything(f"{self._name}.{name}", self.calls)

    def __call__(self, *_: Any, **__: Any) -> Anything:
        self.calls.append(self._name)
        return self

    def __enter__(self) -> Anything:
        return self

    def __exit__(self, *_: object) -> None:
        self.calls.append(f"{self._name} ends")


@pytest.fixture
def played(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Whatever the groups use, played; the names of what was called."""
    calls: list[str] = []
    for path in (
        "cliport_benchmark.observer.Observer",
        "cliport_perception.heightmap_builder.HeightmapBuilder",
        "cliport_policy.load_policy",
        "sim_bridge.rendering.camera.SimCamera",
        "sim_bridge.scene.reset_scene",
        "sim_bridge.world.SimWorld",
        "panda_executor.model.PandaModel",
        "panda_executor.transfer.TransferPlanner",
    ):
        monkeypatch.setattr(path, Anything(path.rpartition(".")[2], calls))
    clock = iter(0.25 * n for n in range(10_000))
    monkeypatch.setattr(bench.time, "perf_counter", lambda: next(clock))
    monkeypatch.setattr(bench.time, "sleep", lambda seconds: calls.append(f"sleeps {seconds} s"))
    return calls


def table(rows: Any) -> list[tuple[str, float, str, int]]:
    return [(row.name, row.median, row.unit, row.n) for row in rows]


def test_camera_and_action(played: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    timed: list[tuple[str, int]] = []

    def time_once(name: str, call: Callable[[], object], n: int) -> bench.Row:
        timed.append((name, n))
        call()
        return bench.row(name, [1.0], "ms")

    calls = [("a_frame", lambda: played.append("framed"), 50)]
    monkeypatch.setattr("cliport_benchmark.bench_perception.frame_calls", lambda frame, builder: calls)
    monkeypatch.setattr(bench, "timed", time_once)
    assert len(bench.bench_camera_and_action()) == 6
    names = ["render_960x540", "render_960x540_no_noise", "render_window", "render_window_new_look"]
    assert timed == [("action_default", 30), ("a_frame", 50), *((name, 30) for name in names)]
    assert played.count("SimCamera.capture") == 3 and played.count("Observer.frame") == 2
    assert played.count("Observer.new_scene") == 1 and played[-1] == "SimWorld.close"
    assert played.count("load_policy.infer") == 1 and played.count("framed") == 1


def test_planning(played: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    action = PickPlaceAction(POSE, POSE)
    scenes = (SimpleNamespace(expert_action=lambda n=n: None if n == 3 else action) for n in range(99))
    monkeypatch.setattr("sim_bridge.scene.reset_scene", lambda world, task, split, seed: next(scenes))
    monkeypatch.setattr("sim_bridge.world.SimConfig", lambda: SimpleNamespace(workspace=None))
    monkeypatch.setattr("cliport_benchmark.bench_planning.compared", lambda n: [("rrt", [float(n), 2.0 * n], 75.0)])
    drawn: list[Any] = []
    monkeypatch.setattr("cliport_benchmark.bench_planning.drawn", lambda planner, plan: drawn.append(plan))
    assert table(bench.bench_planning()) == [
        ("plan_transfer", 250.0, "ms", 19),
        ("plan_preview", 250.0, "ms", 19),
        ("search_clutter_rrt", 30.0, "ms", 2),
        ("search_clutter_rrt_found", 75.0, "%", 1),
    ]
    assert played.count("TransferPlanner.plan") == len(drawn) == 19 and "SimWorld.close" in played


class MotionClient:
    """A user of the graph whose arm does not move, or does not come to rest, in some scenes."""

    def __init__(self, still: tuple[int, ...] = (), restless: tuple[int, ...] = ()) -> None:
        self.still, self.restless, self.seed = still, restless, -1
        self.asked: list[tuple[Any, ...]] = []

    def __enter__(self) -> MotionClient:
        return self

    def __exit__(self, *_: object) -> None:
        return

    def wait_ready(self, timeout: float, alive: Callable[[], bool]) -> None:
        self.asked.append((timeout,))

    def reset(self, task: str, split: str, seed: int) -> str:
        self.seed = seed
        return f"sentence {seed}"

    def seconds_to_motion(self, sentence: str, timeout: float) -> float:
        self.asked.append((sentence, timeout))
        if self.seed in self.still:
            raise BenchmarkError("the arm did not move")
        return float(self.seed)

    def instruct(self, text: str) -> None:
        self.asked.append((text,))

    def wait_at_rest(self, timeout: float) -> None:
        self.asked.append((timeout,))
        if self.seed in self.restless:
            raise BenchmarkError("the arm still moves")


def test_first_motion(played: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    client = MotionClient()
    monkeypatch.setattr("cliport_benchmark.bench_motion.GraphClient", lambda name: client)
    monkeypatch.setattr("cliport_benchmark.bench_motion.GraphProcess", Anything("GraphProcess", played))
    assert table(bench.bench_first_motion()) == [("first_motion", 2.0, "s", 5)]
    each = [[(f"sentence {n}", 60.0), ("",), (60.0,)] for n in range(5)]
    assert client.asked == [(300.0,), *(line for lines in each for line in lines)]
    assert played.count("sleeps 1.0 s") == 5 and played[-1] == "GraphProcess ends"


@pytest.mark.parametrize(
    ("client", "median", "n", "said"),
    [
        (MotionClient(still=(0, 3)), 2.0, 3, "first_motion has 3 of 5 times; scene 0: the arm did not move"),
        (MotionClient(restless=(1,)), 2.0, 5, "first_motion has 5 of 5 times; scene 1: the arm still moves"),
    ],
)
def test_a_scene_without_motion_does_not_cost_the_others(
    client: MotionClient, median: float, n: int, said: str, played: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cliport_benchmark.bench_motion.GraphClient", lambda name: client)
    monkeypatch.setattr("cliport_benchmark.bench_motion.GraphProcess", Anything("GraphProcess", played))
    rows = bench.bench_first_motion()
    assert table([next(rows)]) == [("first_motion", median, "s", n)]
    with pytest.raises(BenchmarkError, match=f"^{said}$"):
        next(rows)
    assert client.seed == 4


def test_no_scene_is_waited_for_when_a_node_has_died(monkeypatch: pytest.MonkeyPatch) -> None:
    client = MotionClient(still=(1,))
    monkeypatch.setattr(bench.time, "sleep", lambda seconds: None)
    graph: Any = SimpleNamespace(healthy=False)
    assert bench_motion._measured(graph, client, "align-rope", 5) == ([0.0], ["scene 1: the arm did not move"])  # type: ignore[arg-type]


def test_scenes_that_are_not_planned_do_not_cost_the_others(played: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    class Planner(Anything):
        def plan(self, *_: object) -> None:
            self.calls.append("planned")
            if self.calls.count("planned") <= 2:
                raise ExecutorError("planning took too long")

    monkeypatch.setattr("panda_executor.transfer.TransferPlanner", lambda _: Planner("TransferPlanner", played))
    monkeypatch.setattr("sim_bridge.world.SimConfig", lambda: SimpleNamespace(workspace=None))
    scene = SimpleNamespace(expert_action=lambda: PickPlaceAction(POSE, POSE))
    monkeypatch.setattr("sim_bridge.scene.reset_scene", lambda *_: scene)
    monkeypatch.setattr("cliport_benchmark.bench_planning.compared", lambda n: [("rrt", [1.0], 75.0)])
    monkeypatch.setattr("cliport_benchmark.bench_planning.drawn", lambda planner, plan: None)
    monkeypatch.setattr(bench, "BENCHES", {"planning": bench.bench_planning})
    rows: list[bench.Row] = []
    assert bench._measure(None, rows) == 1
    names = ["plan_transfer", "plan_preview", "search_clutter_rrt", "search_clutter_rrt_found"]
    assert [(r.name, r.n) for r in rows] == [*((name, 18) for name in names[:2]), *((name, 1) for name in names[2:])]


def test_inference_and_the_network_of_the_papers_size(monkeypatch: pytest.MonkeyPatch) -> None:
    found = {"loading": [1.0], "actions": [3.0, 5.0], "resident": [700.0], "highest": [900.0]}
    done: list[int] = []
    monkeypatch.setattr("cliport_benchmark.bench_inference.footprint", lambda checkpoint: found)
    monkeypatch.setattr("cliport_benchmark.bench_inference.paper_size_footprint", lambda: found)
    monkeypatch.setattr("cliport_benchmark.bench_inference.tricks", lambda: [("trick", lambda: done.append(1))])
    rows = table(bench.bench_inference())
    assert rows[:3] == [
        ("load_default", 1.0, "s", 1),
        ("resident_default", 700.0, "MB", 1),
        ("highest_default", 900.0, "MB", 1),
    ]
    assert (rows[3][0], rows[3][3], len(done)) == ("trick", 10, 13), "three calls before those that are timed"
    assert table(bench.bench_paper_size()) == [
        ("load_cliport", 1.0, "s", 1),
        ("action_cliport", 4.0, "ms", 2),
        ("resident_cliport", 700.0, "MB", 1),
        ("highest_cliport", 900.0, "MB", 1),
    ]


def test_training(monkeypatch: pytest.MonkeyPatch) -> None:
    trained: list[tuple[int, int, int, int]] = []
    clock = [0.0]

    class Trainer:
        def __init__(self, sources: Any, out: Any, network: Any, config: Any, encoder: Any, facts: Any) -> None:
            trained.append(
                (config.steps, config.phrases_per_goal, config.rotator_rotations, config.transport_rotations)
            )
            self.steps, self.loader = config.steps, SimpleNamespace(steps=lambda first: iter(self._load, None))
            self.batch = config.batch_size

        def run(self, on_step: Callable[[object], None]) -> None:
            for _ in range(self.steps):
                clock[0] += 0.5 * self.batch
                on_step(None)

        def _load(self) -> int:
            clock[0] += 0.25 * self.batch
            return 1

    made: list[Any] = []
    monkeypatch.setattr(bench.time, "perf_counter", lambda: clock[0])
    monkeypatch.setattr(
        "cliport_benchmark.generate.make_part", lambda config, folder, index: made.append((config, index))
    )
    monkeypatch.setattr("cliport_policy.data.demonstrations.load_demonstrations", lambda folder: None)
    monkeypatch.setattr("cliport_policy.data.mixture.Source", lambda data: data)
    monkeypatch.setattr("cliport_policy.language.shared_encoder", lambda: None)
    monkeypatch.setattr("cliport_policy.training.allocator.keep_freed_memory", lambda: None)
    monkeypatch.setattr("cliport_policy.training.trainer.Trainer", Trainer)
    assert table(bench.bench_training()) == [
        ("train_sample_compact", 500.0, "ms", 13),
        ("train_sample_compact_all", 500.0, "ms", 5),
        ("load_sample", 250.0, "ms", 8),
    ]
    ((config, index),) = made
    assert (config.episodes, config.split, index) == (12, "train", 0)
    assert trained == [(16, 3, 12, 4), (8, 3, 0, 0)]


def test_the_perception_node(monkeypatch: pytest.MonkeyPatch) -> None:
    found = {"rate": [9.9], "heightmap": [1.0, 2.0, 42.0], "cloud": [7.0], "cores": [0.5]}
    monkeypatch.setattr("cliport_benchmark.bench_perception_node.node_figures", lambda task: found)
    assert table(bench.bench_perception_node()) == [
        ("perception_node_rate", 9.9, "Hz", 1),
        ("perception_node_heightmap_age", 2.0, "ms", 3),
        ("perception_node_heightmap_age_p95", 38.0, "ms", 1),
        ("perception_node_cloud_age", 7.0, "ms", 1),
        ("perception_node_cloud_age_p95", 7.0, "ms", 1),
        ("perception_node_cpu_cores", 0.5, "cores", 1),
    ]


def test_a_serialized_message_gets_another_stamp_and_stays_the_same_beyond_it() -> None:
    pytest.importorskip("sensor_msgs.msg")
    from rclpy.serialization import deserialize_message, serialize_message
    from sensor_msgs.msg import Image

    from cliport_benchmark.bench_perception_node import stamped

    raw = bytes(serialize_message(Image(encoding="rgb8", width=1, height=1, step=3, data=b"abc")))
    image = deserialize_message(stamped(raw, 12_000_000_034), Image)
    assert (image.header.stamp.sec, image.header.stamp.nanosec) == (12, 34)
    assert (image.encoding, bytes(image.data)) == ("rgb8", b"abc")


def test_each_group_has_a_name_and_two_are_measured_on_request() -> None:
    assert set(bench.ON_REQUEST) < set(bench.BENCHES) and len(bench.BENCHES) == 9
    assert list(bench.versions()) == list(bench.PACKAGES) and all(bench.versions().values())
