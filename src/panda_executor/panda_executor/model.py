"""The arm in Pinocchio: kinematics of the tcp, and self-collision."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin

from cliport_core.pose import Pose
from panda_executor.arm_cover import ArmCover
from panda_executor.errors import RobotDescriptionError
from panda_model import ARM_DOF, ArmModel, FloatArray, load_preset
from panda_model.description import RobotDescription, load_description

_STANDING = ("link0", "link1", "link2")  # near the base, whatever the arm does
_REACHING = ("link3", "link4", "link5", "link6", "link7")  # over the table; the hand has boxes of its own
_FIXED = "fixed:"  # marks the boxes that stand in the base frame among the geometry objects


class PandaModel:
    """Seven arm joints with the fingers fixed; not safe to share between threads.

    The fingers stand open in the self-collision model: that is the larger hand. Link meshes are replaced by
    their convex hulls, which contain them and are checked about five times as fast.

    Args:
        arm: names, limits and hand; by default the Panda. The URDF's own limits are not used.
        self_clearance: links closer than this count as colliding [m]; 0.03 m is by what Franka pads its own capsules.
        description: URDF and SRDF; by default those that the arm's preset names.

    Raises:
        DescriptionError: when the preset's URDF is not installed.
        RobotDescriptionError: when the URDF has no tcp frame, not seven joints before it and two fingers beside them,
            or a mesh is missing.
    """

    def __init__(
        self,
        arm: ArmModel | None = None,
        self_clearance: float = 0.03,
        description: RobotDescription | None = None,
    ) -> None:
        self.arm = arm or load_preset()
        self.limits = self.arm.limits
        description = description or load_description(self.arm)
        self._names = description.prefix, self.arm.prefix
        full, geometry = _read(description)
        fingers = _finger_joints(full, self.named(self.arm.tcp_frame))
        rest = pin.neutral(full)
        for joint in fingers:
            rest[full.joints[joint].idx_q] = self.arm.hand.opening / 2.0
        self.model, self.geometry = pin.buildReducedModel(full, geometry, fingers, rest)
        self._use_hulls()
        self.reaching = ArmCover.of_links(self.model, self.geometry, self._links(_REACHING))
        self.standing = ArmCover.of_links(self.model, self.geometry, self._links(_STANDING))
        self.geometry.addAllCollisionPairs()
        pin.removeCollisionPairsFromXML(self.model, self.geometry, description.srdf)
        self.data = self.model.createData()
        self._tcp = self.model.getFrameId(self.named(self.arm.tcp_frame))
        self._self_clearance = self_clearance
        self.fixed_boxes: dict[str, tuple[FloatArray, FloatArray]] = {}  # centre and half edges, with clearance [m]
        self._geometry_data = self._new_geometry_data()

    def named(self, name: str) -> str:
        """Return what the robot description calls a link, frame or joint of the preset."""
        there, here = self._names
        return there + name.removeprefix(here) if name.startswith(here) else name

    def link(self, name: str) -> str:
        """Return the robot description's name of a link, such as "link3" or "hand"."""
        return self._names[0] + name

    def _links(self, names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(self.link(name) for name in names)

    def own_spheres(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return centres (N, 3) [m, base frame] and radii (N,) [m] of spheres that hold the links but not the hand."""
        pin.forwardKinematics(self.model, self.data, positions)
        covers = (self.standing, self.reaching)
        return np.concatenate([c.placed(self.data) for c in covers]), np.concatenate([c.radii for c in covers])

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
        """Return tcp in base at joint positions (7,) [rad]."""
        rotation, translation = self.tcp_arrays(positions)
        return Pose(rotation, translation)

    def tcp_arrays(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return `tcp_pose` as (3, 3), (3,) [m], without the checks of the value type; for inner loops."""
        pin.forwardKinematics(self.model, self.data, positions)
        return self.tcp_arrays_now()

    def tcp_arrays_now(self) -> tuple[FloatArray, FloatArray]:
        """Return `tcp_arrays` of the positions for which kinematics or collisions were computed last."""
        placement = pin.updateFramePlacement(self.model, self.data, self._tcp)
        return placement.rotation.copy(), placement.translation.copy()

    def frame_pose(self, name: str, positions: FloatArray) -> Pose:
        """Return the pose of a frame of the preset in base.

        Raises:
            RobotDescriptionError: when there is no frame of that name.
        """
        frame = self.named(name)
        if not self.model.existFrame(frame):
            raise RobotDescriptionError(f"the robot has no frame '{frame}'")
        pin.forwardKinematics(self.model, self.data, positions)
        placement = pin.updateFramePlacement(self.model, self.data, self.model.getFrameId(frame))
        return Pose(placement.rotation.copy(), placement.translation.copy())

    def tcp_jacobian(self, positions: FloatArray) -> FloatArray:
        """Return the tcp's Jacobian (6, 7), linear [m/rad] over angular [rad/rad], both in the base frame."""
        jacobian: FloatArray = pin.computeFrameJacobian(
            self.model, self.data, positions, self._tcp, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        return jacobian

    def tcp_error_and_jacobian(self, positions: FloatArray, target: pin.SE3) -> tuple[FloatArray, FloatArray]:
        """Return the twist (6,) from the tcp to `target` and the Jacobian (6, 7), both in the tcp frame."""
        pin.computeJointJacobians(self.model, self.data, positions)
        placement = pin.updateFramePlacement(self.model, self.data, self._tcp)
        jacobian: FloatArray = pin.getFrameJacobian(self.model, self.data, self._tcp, pin.ReferenceFrame.LOCAL)
        error: FloatArray = pin.log6(placement.actInv(target)).vector
        return error, jacobian

    def put_fixed_box(
        self, name: str, size: FloatArray, centre: FloatArray, links: tuple[str, ...], clearance: float
    ) -> None:
        """Put a box that stands still in the base frame, in place of one of that name.

        Args:
            size: edges (3,) [m]; centre: (3,) [m] in base; clearance: added distance [m];
            links: the description's links against whose geometries it is checked.
        """
        placement = pin.SE3(np.eye(3), np.asarray(centre, dtype=np.float64))
        self.fixed_boxes[name] = np.asarray(centre, dtype=np.float64), np.asarray(size) / 2.0 + clearance
        x, y, z = (np.asarray(size, dtype=np.float64) + 2.0 * clearance).tolist()
        shape = coal.Box(x, y, z)
        if self.has_fixed_box(name):
            item = self.geometry.geometryObjects[self.geometry.getGeometryId(_FIXED + name)]
            item.geometry, item.placement = shape, placement
        else:
            self._add_fixed(pin.GeometryObject(_FIXED + name, 0, placement, shape), links)
        self._geometry_data = self._new_geometry_data()
        for pair, request in zip(self.geometry.collisionPairs, self._geometry_data.collisionRequests, strict=True):
            if self.geometry.geometryObjects[pair.second].name.startswith(_FIXED):
                request.security_margin = 0.0

    def _add_fixed(self, box: pin.GeometryObject, links: tuple[str, ...]) -> None:
        index = self.geometry.addGeometryObject(box)
        for other, geometry in enumerate(self.geometry.geometryObjects):
            if geometry.name.startswith(_FIXED):
                continue
            if self.model.frames[geometry.parentFrame].name in links:
                self.geometry.addCollisionPair(pin.CollisionPair(other, index))

    def has_fixed_box(self, name: str) -> bool:
        """Return True if a box of that name stands in the model."""
        return any(item.name == _FIXED + name for item in self.geometry.geometryObjects)

    def in_collision(self, positions: FloatArray) -> bool:
        """Return True if links come closer to each other, or to a fixed box, than allowed."""
        return bool(pin.computeCollisions(self.model, self.data, self.geometry, self._geometry_data, positions, True))

    def colliding_pair(self, positions: FloatArray) -> str | None:
        """Return the first pair that collides, in words, or None."""
        if not self.in_collision(positions):
            return None
        for pair, result in zip(self.geometry.collisionPairs, self._geometry_data.collisionResults, strict=True):
            if result.isCollision():
                names = [self.geometry.geometryObjects[i].name for i in (pair.first, pair.second)]
                return " and ".join(n.removeprefix(_FIXED).removesuffix("_0") for n in names)
        return "links"


def _finger_joints(full: pin.Model, tcp_frame: str) -> list[int]:
    """Return the two joints that do not move the tcp, by structure: a driver may have other names for them.

    Raises:
        RobotDescriptionError: when there are not two, or not seven that do move it.
    """
    if not full.existFrame(tcp_frame):
        raise RobotDescriptionError(f"the robot description has no frame '{tcp_frame}'")
    arm = list(full.supports[full.frames[full.getFrameId(tcp_frame)].parentJoint])[1:]  # without the universe
    fingers = [joint for joint in range(1, full.njoints) if joint not in arm]
    if len(arm) != ARM_DOF or any(full.joints[joint].nq != 1 for joint in (*arm, *fingers)):
        raise RobotDescriptionError(
            f"the robot description has {len(arm)} joints from its base to '{tcp_frame}', expected {ARM_DOF} of one "
            f"angle each: {', '.join(full.names[joint] for joint in arm) or 'none'}"
        )
    if len(fingers) != 2:
        names = ", ".join(full.names[joint] for joint in fingers) or "none"
        raise RobotDescriptionError(
            f"the robot description has these joints beside the arm's, not two fingers: {names}"
        )
    return fingers


def _read(description: RobotDescription) -> tuple[pin.Model, pin.GeometryModel]:
    try:
        model = pin.buildModelFromXML(description.urdf)
        geometry = pin.buildGeomFromUrdfString(
            model, description.urdf, pin.GeometryType.COLLISION, package_dirs=list(description.package_folders)
        )
    except (ValueError, RuntimeError) as error:
        raise RobotDescriptionError(f"the robot description cannot be used: {' '.join(str(error).split())}") from None
    return model, geometry
