"""`ros2 run cliport_benchmark depth_error`: heightmaps of each kind of camera beside the scene's true surface."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pybullet
from scipy import ndimage

from cliport_benchmark.errors import OptionError
from cliport_benchmark.observer import Observer
from cliport_core import Heightmap
from cliport_core.command_line import CommandParser
from cliport_core.errors import CoreError
from cliport_perception.camera_health import CameraHealth, HealthLimits
from cliport_perception.frame_processor import FrameProcessor
from cliport_perception.table_watch import TableLimits
from sim_bridge.errors import SimBridgeError
from sim_bridge.rendering.sensor_noise import SensorKind
from sim_bridge.scene import reset_scene
from sim_bridge.world import SimWorld

TASK = "put-blocks-in-bowls-seen-colors"
_TOP = 0.5  # from which rays fall [m]
_FLAT = 0.002  # a surface whose neighbouring cells differ by less has no edge there [m]
_ON_TABLE = 0.001  # what is higher is a thing [m]
_SETTLED = 3  # frames after which the noise is known; the last is measured

Mask = npt.NDArray[np.bool_]


class TrueSurface(NamedTuple):
    """Heights (rows, cols) [m] of the surface in each cell's middle, and which of these the camera sees."""

    height: npt.NDArray[np.float64]
    seen: Mask

    @property
    def edges(self) -> Mask:
        """Cells beside a step."""
        near = ndimage.maximum_filter(self.height, 5) - ndimage.minimum_filter(self.height, 5)
        return np.asarray(near > _FLAT)

    @property
    def table(self) -> Mask:
        """Seen cells of the bare table, away from things."""
        return (self.height <= _ON_TABLE) & self.seen & ~self.edges

    @property
    def tops(self) -> Mask:
        """Seen cells of things' tops, away from their rims."""
        return (self.height > _ON_TABLE) & self.seen & ~self.edges


class DepthError(NamedTuple):
    """Errors of a heightmap [mm]: mean over the table and over tops, standard deviation over the table.

    holes: share of the seen cells without depth, edges included.
    """

    kind: SensorKind
    frames: int
    table: float
    spread: float
    tops: float
    holes: float

    def in_words(self) -> str:
        """Return a row of the table that the command prints."""
        numbers = f"{self.table:+.2f} | {self.spread:.2f} | {self.tops:+.2f} | {100 * self.holes:.1f} %"
        return f"| {self.kind.value} | {self.frames} | {numbers} |"


def true_surface(world: SimWorld, heightmap: Heightmap, camera: npt.NDArray[np.float64]) -> TrueSurface:
    """Return what lies in the cells of a heightmap, by rays from straight above; camera: its position [m]."""
    spec = heightmap.workspace
    rows, cols = np.mgrid[0 : spec.rows, 0 : spec.cols]
    x = spec.x_min + (cols + 0.5) * spec.pixel_size
    y = spec.y_min + (rows + 0.5) * spec.pixel_size
    above = np.stack([x, y, np.full(spec.shape, _TOP)], axis=-1).reshape(-1, 3)
    surface = _struck(world, above, above * [1, 1, 0] - [0, 0, 0.05])
    surface[:, 2] = np.maximum(surface[:, 2], 0.0)
    lines = _struck(world, np.broadcast_to(camera, surface.shape), surface)
    seen = np.linalg.norm(lines - surface, axis=1) < 0.003
    return TrueSurface(surface[:, 2].reshape(spec.shape), seen.reshape(spec.shape))


def _struck(world: SimWorld, starts: npt.NDArray[np.float64], ends: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return where rays (N, 3) to (N, 3) first meet anything (N, 3) [m]; their end where they do not."""
    found = []
    most = pybullet.MAX_RAY_INTERSECTION_BATCH_SIZE - 1
    for i in range(0, len(starts), most):
        hits = pybullet.rayTestBatch(
            starts[i : i + most].tolist(), ends[i : i + most].tolist(), physicsClientId=world.client
        )
        found += [hit[3] if hit[0] >= 0 else end for hit, end in zip(hits, ends[i : i + most].tolist())]
    return np.array(found)


def true_scene(world: SimWorld) -> TrueSurface:
    """Return what the shipped camera could see of a world."""
    observer = Observer(world.config, n_threads=1, camera_kind=SensorKind.PERFECT)
    return true_surface(world, observer.observe(world), observer.camera.camera_in_base.translation)


def measure(world: SimWorld, truth: TrueSurface, kind: SensorKind, frames: int) -> DepthError:
    """Return the error of a heightmap as the perception node makes it, depth averaged over `frames`."""
    observer = Observer(world.config, n_threads=1, camera_kind=kind)
    observer.new_scene(np.random.default_rng(0))
    camera, health = observer.camera, CameraHealth({}, HealthLimits())
    processor = FrameProcessor(observer.workspace, health, 0.0, 0.0, table=TableLimits(), depth_frames=frames)
    for stamp in range(max(_SETTLED, frames)):
        frame = observer.frame(world)
        products = processor.process(frame.color, frame.depth, camera.intrinsics, camera.camera_in_base, stamp)
    heightmap = products.heightmap
    off = 1e3 * (heightmap.height - truth.height)
    table, tops = (off[cells & heightmap.valid] for cells in (truth.table, truth.tops))
    holes = 1.0 - float(heightmap.valid[truth.seen].mean())
    return DepthError(kind, frames, float(table.mean()), float(table.std()), float(tops.mean()), holes)


def depth_errors(task: str, seed: int, kinds: Sequence[SensorKind], frames: Sequence[int]) -> Iterator[DepthError]:
    """Yield the errors of each kind with each number of frames, in a scene of the split val."""
    world = SimWorld()
    try:
        reset_scene(world, task, "val", seed)
        truth = true_scene(world)
        for kind in kinds:
            for count in frames:
                yield measure(world, truth, kind, count)
    finally:
        world.close()


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when everything was measured, 1 on an error."""
    names = [kind.value for kind in SensorKind]
    parser = CommandParser(prog="depth_error", description="Heightmaps beside the scene's true surface.")
    parser.add_argument("--task", default=TASK, help=f"{TASK}, unless another is given")
    parser.add_argument("--seed", type=int, default=2, help="of the scene in the split val; 2")
    parser.add_argument("--camera-kind", nargs="+", choices=names, default=names, help="all of them")
    parser.add_argument("--frames", type=int, nargs="+", default=[1, 3, 5], help="over which depth is averaged; 1 3 5")
    options = parser.parse_args(arguments)
    try:
        if min(options.frames) < 1:
            raise OptionError(f"--frames must be 1 or more, got {min(options.frames)}")
        print("| kind | depth_frames | table [mm] | spread [mm] | tops [mm] | holes |\n|---|---:|---:|---:|---:|---:|")
        for row in depth_errors(
            options.task, options.seed, [SensorKind(n) for n in options.camera_kind], options.frames
        ):
            print(row.in_words(), flush=True)
    except (CoreError, OptionError, SimBridgeError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
