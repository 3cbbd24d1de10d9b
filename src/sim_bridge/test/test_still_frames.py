"""A camera that reuses still frames shows the same as one that renders each, and sees every movement."""

import numpy as np

from sim_bridge.rendering.camera import CameraConfig, SimCamera
from sim_bridge.rendering.sensor_noise import NoiseConfig
from sim_bridge.scene import reset_scene
from sim_bridge.world import SimConfig, SimWorld

TASK = "put-blocks-in-bowls-seen-colors"


def test_reused_frames_are_the_rendered_ones_until_something_moves() -> None:
    world = SimWorld(SimConfig())
    rng = np.random.default_rng(0)
    perfect = NoiseConfig.none()
    reusing, rendering = (SimCamera(CameraConfig(noise=perfect, reuse_still=reuse)) for reuse in (True, False))
    try:
        for seed in (0, 1):
            reset_scene(world, TASK, "val", seed)
            for _ in range(2):
                a, b = reusing.capture(world, rng), rendering.capture(world, rng)
                assert np.array_equal(a.color, b.color)
                assert np.array_equal(a.depth, b.depth, equal_nan=True)
        before = reusing.capture(world, rng)
        positions = world.panda.state().positions.copy()
        positions[0] += 0.3
        world.panda.command(positions, np.zeros(7))
        for _ in range(240):
            world.step()
        assert not np.array_equal(before.color, reusing.capture(world, rng).color)
    finally:
        world.close()
