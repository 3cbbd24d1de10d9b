from __future__ import annotations

import math

import numpy as np
import pytest

from cliport_core import PlanarPose, Pose


def random_pose(rng: np.random.Generator) -> Pose:
    return Pose.from_quaternion_xyzw(rng.normal(size=4), rng.normal(size=3))


@pytest.mark.parametrize("seed", range(20))
def test_group_axioms(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, c = (random_pose(rng) for _ in range(3))
    assert ((a @ b) @ c).is_close(a @ (b @ c), 1e-12)
    assert (a @ a.inverse()).is_close(Pose.identity(), 1e-12)
    assert (a @ Pose.identity()).is_close(a, 1e-15)
    np.testing.assert_allclose((a @ b).as_matrix(), a.as_matrix() @ b.as_matrix(), atol=1e-12)
    points = rng.normal(size=(4, 5, 3))
    np.testing.assert_allclose((a @ b).apply(points), a.apply(b.apply(points)), atol=1e-12)
    np.testing.assert_allclose(a.inverse().apply(a.apply(points)), points, atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_quaternion_round_trip(seed: int) -> None:
    pose = random_pose(np.random.default_rng(seed))
    q = pose.as_quaternion_xyzw()
    assert np.linalg.norm(q) == pytest.approx(1.0)
    assert q[3] >= 0.0
    assert Pose.from_quaternion_xyzw(q, pose.translation).is_close(pose, 1e-12)


@pytest.mark.parametrize("rpy", [(math.pi, 0, 0), (0, math.pi, 0), (0, 0, math.pi), (math.pi, 0, math.pi / 2)])
def test_half_turns_have_quaternions(rpy: tuple[float, float, float]) -> None:
    pose = Pose.from_xyz_rpy((1, 2, 3), rpy)
    assert Pose.from_quaternion_xyzw(pose.as_quaternion_xyzw(), pose.translation).is_close(pose, 1e-12)


def test_rpy_is_about_fixed_axes() -> None:
    roll, pitch, yaw = 0.3, -0.2, 1.1
    about = [Pose.from_xyz_rpy((0, 0, 0), v) for v in ((roll, 0, 0), (0, pitch, 0), (0, 0, yaw))]
    assert (about[2] @ about[1] @ about[0]).is_close(Pose.from_xyz_rpy((0, 0, 0), (roll, pitch, yaw)), 1e-12)
    np.testing.assert_allclose(about[2].apply([1, 0, 0]), [math.cos(yaw), math.sin(yaw), 0])


def test_poses_cannot_be_changed_from_outside() -> None:
    rotation = np.eye(3)
    pose = Pose(rotation, np.zeros(3))
    rotation[0, 0] = 5.0
    assert pose.rotation[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        pose.translation[0] = 1.0


@pytest.mark.parametrize("rotation", [np.zeros((3, 3)), np.diag([1, 1, -1.0]), np.full((3, 3), np.nan), np.eye(4)])
def test_what_is_no_rotation_is_refused(rotation: np.ndarray) -> None:
    with pytest.raises(ValueError, match="Pose needs"):
        Pose(rotation, np.zeros(3))


@pytest.mark.parametrize("q", [(0, 0, 0, 0), (math.nan, 0, 0, 1), (math.inf, 0, 0, 1)])
def test_quaternions_without_direction_are_refused(q: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="no direction"):
        Pose.from_quaternion_xyzw(q, (0, 0, 0))


@pytest.mark.parametrize("eye", [(1.2, 0.3, 0.9), (0.45, 0.0, 1.5)])
def test_looking_at_puts_the_target_on_the_optical_axis(eye: tuple[float, float, float]) -> None:
    pose = Pose.looking_at(eye, (0.45, 0.0, 0.0))
    seen = pose.inverse().apply([0.45, 0.0, 0.0])
    assert seen[:2] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert seen[2] > 0
    assert pose.rotation[2, 1] <= 1e-12  # image down is not up


def test_planar_pose_round_trip() -> None:
    planar = PlanarPose(0.4, -0.1, 2.5)
    back = PlanarPose.from_pose(planar.as_pose(0.2))
    assert (back.x, back.y, back.yaw) == pytest.approx((0.4, -0.1, 2.5))


@pytest.mark.parametrize("seed", range(5))
def test_planar_poses_compose_as_poses_in_space_do(seed: int) -> None:
    a, b = (PlanarPose(*np.random.default_rng([seed, i]).normal(size=3)) for i in range(2))
    assert (a @ b).as_pose().is_close(a.as_pose() @ b.as_pose())
    assert a.inverse().as_pose().is_close(a.as_pose().inverse())
    assert (a @ a.inverse()).as_pose().is_close(Pose.identity())
    assert (a @ PlanarPose.identity()) == a
    points = np.random.default_rng(seed).normal(size=(2, 4, 2))
    in_space = a.as_pose().apply(np.concatenate([points, np.zeros((2, 4, 1))], axis=-1))
    np.testing.assert_allclose(a.apply(points), in_space[..., :2])
    np.testing.assert_allclose(a.apply((1.0, 0.0)), np.add((a.x, a.y), a.direction))


def test_planar_pose_says_when_it_is_not_finite() -> None:
    assert PlanarPose(0.1, 0.2, 0.3).is_finite()
    for i in range(3):
        assert not PlanarPose(*(math.nan if i == j else 0.0 for j in range(3))).is_finite()


def test_close_poses_differ_by_less_than_the_tolerance_wherever_they_are() -> None:
    far = Pose.from_xyz_rpy((100.0, -50.0, 3.0), (0.1, 0.2, 0.3))
    for axis in range(3):
        shift = np.zeros(3)
        shift[axis] = 1e-4
        moved = Pose(far.rotation, far.translation + shift)
        assert moved.is_close(far, tolerance=1.1e-4) and not moved.is_close(far, tolerance=0.9e-4)
        assert not moved.is_close(far)
    turned = Pose.from_xyz_rpy((100.0, -50.0, 3.0), (0.1, 0.2, 0.301))
    assert turned.is_close(far, tolerance=2e-3) and not turned.is_close(far, tolerance=1e-4)
