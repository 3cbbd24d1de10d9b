"""The Panda in Pinocchio: kinematics of the tcp, and self-collision."""

from __future__ import annotations

import os
from importlib import metadata
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

from cliport_perception.pose import Pose
from panda_executor.errors import RobotDescriptionError
from panda_executor.limits import ARM_DOF, PANDA_LIMITS, FloatArray, JointLimits

TCP_FRAME = "panda_hand_tcp"
HAND_FRAME = "panda_hand"
FINGER_JOINTS = ("panda_finger_joint1", "panda_finger_joint2")

_FIXED = "fixed:"  # marks the boxes that stand in the base frame among the geometry objects
_SHARE = Path("example-robot-data/robots/panda_description")


def find_description() -> Path:
    """The folder of example-robot-data that holds the Panda's URDF, SRDF and meshes.

    Raises:
        RobotDescriptionError: when the package is not installed.
    """
    candidates = [Path(p) / "share" / _SHARE for p in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if p]
    try:
        distribution = metadata.distribution("example-robot-data")
        candidates.insert(0, Path(str(distribution.locate_file("cmeel.prefix/share"))) / _SHARE)
    except metadata.PackageNotFoundError:
        pass
    for folder in candidates:
        if (folder / "urdf" / "panda.urdf").is_file():
            return folder
    raise RobotDescriptionError("no Panda description found; install the package 'example-robot-data'")


class PandaModel:
    """Seven arm joints with the fingers fixed; not safe to share between threads.

    The fingers stand open in the self-collision model: that is the larger hand. Link meshes are replaced by
    their convex hulls, which contain them and are checked about five times as fast.

    Args:
        limits: of the arm's joints; the URDF's own are not used.
        finger_width: full distance between the fingers in the self-collision model [m].
        self_clearance: links closer than this count as colliding [m].
    """

    def __init__(
        self,
        limits: JointLimits = PANDA_LIMITS,
        finger_width: float = 0.08,
        self_clearance: float = 0.01,
        description: Path | None = None,
    ) -> None:
        folder = description or find_description()
        urdf = str(folder / "urdf" / "panda.urdf")
        full = pin.buildModelFromUrdf(urdf)
        # The URDF names its meshes package://example-robot-data/...
        geometry = pin.buildGeomFromUrdf(full, urdf, pin.GeometryType.COLLISION, package_dirs=[str(folder.parents[2])])
        rest = pin.neutral(full)
        rest[ARM_DOF:] = finger_width / 2.0
        fingers = [full.getJointId(name) for name in FINGER_JOINTS]
        self.limits = limits
        self.model, self.geometry = pin.buildReducedModel(full, geometry, fingers, rest)
        if self.model.nq != ARM_DOF:
            raise RobotDescriptionError(f"{urdf} has {self.model.nq} arm joints, expected {ARM_DOF}")
        self._use_hulls()
        self.geometry.addAllCollisionPairs()
        pin.removeCollisionPairs(self.model, self.geometry, str(folder / "srdf" / "panda.srdf"))
        self.data = self.model.createData()
        self._tcp = self.model.getFrameId(TCP_FRAME)
        self._self_clearance = self_clearance
        self._geometry_data = self._new_geometry_data()

    def _use_hulls(self) -> None:
        for item in self.geometry.geometryObjects:
            if hasattr(item.geometry, "buildConvexRepresentation"):
                item.geometry.buildConvexRepresentation(False)
                item.geometry = item.geometry.convex

    def _new_geometry_data(self) -> pin.GeometryData:
        data = pin.GeometryData(self.geometry)
        for request in data.collisionRequests:
            request.security_margin = self._self_clearance
        return data

    def tcp_pose(self, positions: FloatArray) -> Pose:
        """tcp in base at joint positions (7,) [rad]."""
        rotation, translation = self.tcp_arrays(positions)
        return Pose(rotation, translation)

    def tcp_arrays(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """As `tcp_pose`, without the checks of the value type: (3, 3), (3,) [m]; for inner loops."""
        pin.forwardKinematics(self.model, self.data, positions)
        placement = pin.updateFramePlacement(self.model, self.data, self._tcp)
        return placement.rotation.copy(), placement.translation.copy()

    def frame_pose(self, name: str, positions: FloatArray) -> Pose:
        """A named frame of the URDF in base.

        Raises:
            RobotDescriptionError: when there is no frame of that name.
        """
        if not self.model.existFrame(name):
            raise RobotDescriptionError(f"the robot has no frame '{name}'")
        pin.forwardKinematics(self.model, self.data, positions)
        placement = pin.updateFramePlacement(self.model, self.data, self.model.getFrameId(name))
        return Pose(placement.rotation.copy(), placement.translation.copy())

    def tcp_jacobian(self, positions: FloatArray) -> FloatArray:
        """(6, 7) of the tcp, linear [m/rad] over angular [rad/rad], both expressed in the base frame."""
        jacobian: FloatArray = pin.computeFrameJacobian(
            self.model, self.data, positions, self._tcp, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        return jacobian

    def tcp_error_and_jacobian(self, positions: FloatArray, target: pin.SE3) -> tuple[FloatArray, FloatArray]:
        """The twist (6,) from the tcp to `target` and the Jacobian (6, 7), both in the tcp frame."""
        pin.computeJointJacobians(self.model, self.data, positions)
        placement = pin.updateFramePlacement(self.model, self.data, self._tcp)
        jacobian: FloatArray = pin.getFrameJacobian(self.model, self.data, self._tcp, pin.ReferenceFrame.LOCAL)
        error: FloatArray = pin.log6(placement.actInv(target)).vector
        return error, jacobian

    def add_fixed_box(
        self, name: str, size: FloatArray, centre: FloatArray, links: tuple[str, ...], clearance: float
    ) -> None:
        """A box that stands still in the base frame, checked against the named links' geometries.

        Args:
            size: edges (3,) [m]; centre: (3,) [m] in base; links: URDF links; clearance: added distance [m].
        """
        placement = pin.SE3(np.eye(3), np.asarray(centre, dtype=np.float64))
        edges = (np.asarray(size, dtype=np.float64) + 2.0 * clearance).tolist()
        item = pin.GeometryObject(_FIXED + name, 0, placement, coal.Box(*edges))
        index = self.geometry.addGeometryObject(item)
        for other, geometry in enumerate(self.geometry.geometryObjects):
            if geometry.name.startswith(_FIXED):
                continue
            if self.model.frames[geometry.parentFrame].name in links:
                self.geometry.addCollisionPair(pin.CollisionPair(other, index))
        self._geometry_data = self._new_geometry_data()
        for pair, request in zip(self.geometry.collisionPairs, self._geometry_data.collisionRequests, strict=True):
            if self.geometry.geometryObjects[pair.second].name.startswith(_FIXED):
                request.security_margin = 0.0

    def has_fixed_box(self, name: str) -> bool:
        """Whether a box of that name stands in the model."""
        return any(item.name == _FIXED + name for item in self.geometry.geometryObjects)

    def in_collision(self, positions: FloatArray) -> bool:
        """Whether links come closer to each other, or to a fixed box, than allowed."""
        return bool(pin.computeCollisions(self.model, self.data, self.geometry, self._geometry_data, positions, True))

    def colliding_pair(self, positions: FloatArray) -> str | None:
        """The first pair that collides, in words, or None."""
        if not self.in_collision(positions):
            return None
        for pair, result in zip(self.geometry.collisionPairs, self._geometry_data.collisionResults, strict=True):
            if result.isCollision():
                names = [self.geometry.geometryObjects[i].name for i in (pair.first, pair.second)]
                return " and ".join(n.removeprefix(_FIXED).removesuffix("_0") for n in names)
        return "links"
