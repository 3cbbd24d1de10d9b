"""The shipped policy in scenes that it never saw: it acts on what is there, and names what is not."""

import re

import pytest

from cliport_benchmark.observer import Observer
from cliport_benchmark.own_setup import OwnSetup
from cliport_policy.policy import load_policy
from cliport_policy.server.types import ServerConfig
from sim_bridge.scene import Stream, reset_scene, scene_rng
from sim_bridge.world import SimWorld

BOWLS, SEEDS = "put-blocks-in-bowls-seen-colors", range(900, 904)


@pytest.mark.parametrize("absent", ["block", "bowl"])
def test_what_is_missing_is_named_and_what_is_there_is_acted_on(absent: str) -> None:
    """Something else has the colour that is missing: a block's is asked of a bowl, and a bowl's of a block."""
    policy, limits = load_policy(), ServerConfig()
    world = SimWorld(OwnSetup().sim_config())
    observer = Observer(world.config, n_threads=1)
    found: list[bool] = []
    named: list[bool] = []
    for seed in SEEDS:
        task = reset_scene(world, BOWLS, "test", seed)
        observer.new_scene(scene_rng(task.name, task.split, seed, Stream.SCORED_NOISE))
        seen = observer.heightmap(observer.frame(world))
        colors = {name: {thing.color for thing in world.objects if thing.name == name} for name in ("block", "bowl")}
        other = "bowl" if absent == "block" else "block"
        color = sorted(colors[other] - colors[absent])[0]
        asked = re.sub(rf"\w+(?= {absent})", color, task.instruction)
        there, vain = (policy.infer(seen, sentence) for sentence in (task.instruction, asked))
        assert there.null_action(limits.done_threshold, limits.absent_threshold) is None, (seed, there.missing)
        found.append(vain.absent_probability >= limits.absent_threshold)
        named += [vain.missing == f"{color} {absent}"] if vain.missing else []
    world.close()
    assert sum(found) >= len(found) - 1 and len(named) > 1 and all(named), (found, named)
