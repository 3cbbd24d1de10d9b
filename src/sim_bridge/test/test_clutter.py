"""Things that no sentence names: in free room, out of every goal, and the same for the same seed."""

from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from cliport_core import WorkspaceSpec
from sim_bridge.clutter import ClutterConfig, add_clutter
from sim_bridge.colors import COLORS
from sim_bridge.errors import SimulationError
from sim_bridge.objects.clutter_shapes import CLUTTER_PAINTS, clutter_shapes
from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.placing import FINGER_CLEARANCE, outline
from sim_bridge.tasks import TASKS
from sim_bridge.world import SimConfig, SimWorld

MANY = ClutterConfig(least=4, most=6)


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


@pytest.mark.parametrize(
    "name",
    [
        "put-blocks-in-bowls-seen-colors",
        "palletizing-boxes",
        "align-rope",
        "separating-piles-seen-colors",
        "align-box-corner",
        "packing-seen-google-objects-group",
    ],
)
def test_clutter_keeps_clear_of_what_the_task_needs_and_changes_no_score(world: SimWorld, name: str) -> None:
    task = reset_scene(world, name, "val", 2)
    assert isinstance(task, GoalTask)
    own, before = list(world.objects), task.score()
    poses = [world.object_pose(thing) for thing in own]
    action = task.expert_action()
    added = add_clutter(world, task, np.random.default_rng(0), MANY)
    assert added and list(world.objects) == own + added
    assert task.score() == before and task.goals_reached == 0
    for pose, thing in zip(poses, own, strict=True):
        assert np.linalg.norm(world.object_pose(thing).translation - pose.translation) < 5e-4
    assert (action is None) == (task.expert_action() is None)
    workspace = WorkspaceSpec()
    for thing in added:
        assert not any(thing in goal.objects for goal in task.goals)
        seen = outline(world, thing)
        assert workspace.contains(seen).all() and world.object_pose(thing).translation[2] < 0.03
        for goal in task.goals:
            targets = np.array([target.translation[:2] for target in goal.targets])
            assert np.linalg.norm(seen[:, None] - targets[None], axis=-1).min() > 0.03
        for place, radius in task.arrivals:
            assert np.linalg.norm(seen - (place.x, place.y), axis=-1).min() > radius


def test_the_fingers_have_room_beside_an_everyday_object(world: SimWorld) -> None:
    for seed in (2, 3):
        task = reset_scene(world, "packing-seen-google-objects-group", "val", seed)
        own = [thing for thing in world.objects if not thing.fixed]
        for thing in add_clutter(world, task, np.random.default_rng(seed), MANY):
            seen = outline(world, thing)
            for other in own:  # both outlines are convex: corners and edges against corners and edges
                assert outline_distance(seen, outline(world, other)) > FINGER_CLEARANCE - WorkspaceSpec().pixel_size


def outline_distance(first: np.ndarray, second: np.ndarray) -> float:
    """The distance between two convex outlines (N, 2) that do not touch [m]."""
    return min(
        -cv2.pointPolygonTest(polygon.astype(np.float32)[:, None], (float(x), float(y)), True)
        for polygon, corners in ((first, second), (second, first))
        for x, y in corners
    )


def test_the_same_seed_gives_the_same_clutter(world: SimWorld) -> None:
    seen = []
    for _ in range(2):
        task = reset_scene(world, "put-blocks-in-bowls-seen-colors", "test", 5)
        added = add_clutter(world, task, np.random.default_rng(7), MANY)
        seen.append([(thing.name, thing.rgb, world.object_pose(thing).as_matrix().tobytes()) for thing in added])
    assert seen[0] == seen[1]


def test_without_room_there_is_less_and_a_wrong_range_is_refused() -> None:
    world = SimWorld(SimConfig(workspace=WorkspaceSpec(x_min=0.4, x_max=0.64, y_min=-0.2, y_max=0.2)))
    task = reset_scene(world, "stack-block-pyramid", "val", 0)
    assert len(add_clutter(world, task, np.random.default_rng(0), ClutterConfig(20, 20))) < 10
    world.close()
    with pytest.raises(SimulationError, match="clutter of 3 to 2 things"):
        ClutterConfig(3, 2)


def test_no_sentence_names_it_and_no_colour_is_near() -> None:
    names = {word for name in TASKS for word in name.split("-")}
    for shape in clutter_shapes():
        assert shape.name not in names and shape.mesh.vertices[:, 2].max() == pytest.approx(-shape.bottom, abs=1e-6)
        middle = shape.mesh.vertices.mean(axis=0)
        corners = shape.mesh.vertices[shape.mesh.triangles].mean(axis=1)
        assert (((corners - middle) * shape.mesh.normals).sum(axis=1) > 0.0).all()
    for paint in CLUTTER_PAINTS:
        assert min(np.linalg.norm(np.subtract(paint, rgb)) for rgb in COLORS.values()) > 60.0
