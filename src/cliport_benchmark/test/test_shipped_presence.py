"""The shipped policy in scenes that it never saw: it acts on what is there, and names what is not."""

import re
from typing import NamedTuple

import pytest

from cliport_benchmark.observer import Observer
from cliport_benchmark.own_setup import OwnSetup
from cliport_core.heightmap import Heightmap
from cliport_policy.inference import Inference
from cliport_policy.policy import Policy, load_policy
from cliport_policy.server.types import ServerConfig
from sim_bridge.scene import Stream, reset_scene, scene_rng
from sim_bridge.world import SimWorld

BOWLS, SEEDS = "put-blocks-in-bowls-seen-colors", range(900, 904)


class Scene(NamedTuple):
    """What is seen, said and there: colours by name; and what the policy answers to what is said."""

    seen: Heightmap
    said: str
    colors: dict[str, set[str]]
    answer: Inference


@pytest.fixture(scope="module")
def policy() -> Policy:
    return load_policy()


@pytest.fixture(scope="module")
def scenes(policy: Policy) -> list[Scene]:
    world = SimWorld(OwnSetup().sim_config())
    observer = Observer(world.config, n_threads=1)
    made = []
    for seed in SEEDS:
        task = reset_scene(world, BOWLS, "test", seed)
        observer.new_scene(scene_rng(task.name, task.split, seed, Stream.SCORED_NOISE))
        seen = observer.heightmap(observer.frame(world))
        colors = {name: {thing.color for thing in world.objects if thing.name == name} for name in ("block", "bowl")}
        made.append(Scene(seen, task.instruction, colors, policy.infer(seen, task.instruction)))
    world.close()
    return made


@pytest.mark.parametrize(("absent", "other"), [("block", "bowl"), ("bowl", "block")])
def test_what_is_missing_is_named_and_what_is_there_is_acted_on(
    policy: Policy, scenes: list[Scene], absent: str, other: str
) -> None:
    """Something else has the colour that is missing: a block's is asked of a bowl, and a bowl's of a block."""
    limits = ServerConfig()
    found: list[bool] = []
    named: list[bool] = []
    for scene in scenes:
        color = sorted(scene.colors[other] - scene.colors[absent])[0]
        vain = policy.infer(scene.seen, re.sub(rf"\w+(?= {absent})", color, scene.said))
        there = scene.answer.null_action(limits.done_threshold, limits.absent_threshold)
        assert there is None, (scene.said, scene.answer.missing)
        found.append(vain.absent_probability >= limits.absent_threshold)
        named += [vain.missing == f"{color} {absent}"] if vain.missing else []
    assert sum(found) >= len(found) - 1 and len(named) > 1 and all(named), (found, named)
