"""What a recorded episode asks the expert must not change what the expert does."""

import numpy as np

from cliport_benchmark.episode_recorder import EpisodeNumber, record_episode
from cliport_benchmark.observer import Observer
from cliport_core import PickPlaceAction
from sim_bridge.rendering.camera import RgbdFrame
from sim_bridge.scene import reset_scene
from sim_bridge.tasks import PutBlocksInBowls
from sim_bridge.world import SimWorld

TASK = "put-blocks-in-bowls-seen-colors"


class Failing:
    """A hand that never takes anything."""

    def __init__(self) -> None:
        self.picks: list[tuple[float, float]] = []

    def execute(self, action: PickPlaceAction, frame: RgbdFrame) -> None:
        self.picks.append((action.pick.x, action.pick.y))


def test_a_failed_grasp_is_held_against_the_block_that_was_tried() -> None:
    world = SimWorld()
    hand, observer = Failing(), Observer(world.config, n_threads=1)
    for seed in range(50):
        task = reset_scene(world, TASK, "train", seed)
        assert isinstance(task, PutBlocksInBowls)
        if len(task.moves_to_make(task.goals[0])) > 1:
            break
    observer.new_scene(np.random.default_rng(0))
    assert record_episode(world, task, observer, hand, np.random.default_rng(0), 50, EpisodeNumber(0, seed)) is None
    world.close()
    assert hand.picks[0] != hand.picks[1]
