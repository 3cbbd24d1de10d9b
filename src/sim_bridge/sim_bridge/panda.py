"""The Panda arm with its parallel hand in a PyBullet world: state out, joint and finger commands in."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pybullet_data

from cliport_core import Pose
from sim_bridge.bullet import pybullet
from sim_bridge.errors import SimulationError
from sim_bridge.robot import HAND, ROBOT

FloatArray = npt.NDArray[np.float64]

_TCP_IN_HAND = Pose(np.eye(3), np.array([0.0, 0.0, HAND.tcp_from_hand]))
# A finger's motor may be as quick as the whole width is to change: so it keeps up with the controller's pace.
_MOTOR_SPEED = HAND.speed
_POSITION_GAIN = 0.4  # share of the position error that one physics step takes back
_VELOCITY_GAIN = 1.0
_FINGERTIP_FRICTION = 1.5


@dataclass(frozen=True, eq=False)
class ArmState:
    """Reading of the arm's encoders: rad, rad/s, N m for the joints; m, m/s for each of the two fingers."""

    positions: FloatArray  # (7,)
    velocities: FloatArray  # (7,)
    efforts: FloatArray  # (7,)
    finger_positions: FloatArray  # (2,)
    finger_velocities: FloatArray  # (2,)

    @property
    def width(self) -> float:
        """Distance between the fingers [m], 0 to the hand's opening."""
        return float(self.finger_positions.sum())


class PandaArm:
    """The arm in the world of one PyBullet client, its base frame at the origin.

    Joint commands are held by motors that obey the torque limits; the two fingers are coupled by a gear, as
    in the real hand. Commands stay in force until the next one.
    """

    def __init__(self, client: int) -> None:
        self._client = client
        urdf = Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf"
        self.body: int = pybullet.loadURDF(
            str(urdf),
            useFixedBase=True,
            flags=pybullet.URDF_IGNORE_VISUAL_SHAPES,
            physicsClientId=client,
        )
        self.link_indices = self._find_links()
        self._arm_joints = [self.link_indices[name.replace("joint", "link")] for name in ROBOT.arm_joints]
        self._finger_joints = [
            self.link_indices[f"{ROBOT.prefix}leftfinger"],
            self.link_indices[f"{ROBOT.prefix}rightfinger"],
        ]
        self._hand = self.link_indices[ROBOT.hand_frame]
        self._set_up_contacts()
        self.reset_home()

    def state(self) -> ArmState:
        """Return positions, velocities and motor efforts as they are now."""
        arm = pybullet.getJointStates(self.body, self._arm_joints, physicsClientId=self._client)
        fingers = pybullet.getJointStates(self.body, self._finger_joints, physicsClientId=self._client)
        return ArmState(
            np.array([s[0] for s in arm]),
            np.array([s[1] for s in arm]),
            np.array([s[3] for s in arm]),
            np.array([s[0] for s in fingers]),
            np.array([s[1] for s in fingers]),
        )

    def command(self, positions: npt.ArrayLike, velocities: npt.ArrayLike) -> None:
        """Drive the joints to positions (7,) [rad] while moving at velocities (7,) [rad/s].

        Raises:
            SimulationError: when the command is not 7 finite numbers each.
        """
        q, v = np.asarray(positions, dtype=np.float64), np.asarray(velocities, dtype=np.float64)
        if q.shape != (7,) or v.shape != (7,) or not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise SimulationError(f"a joint command needs 7 finite positions and velocities, got {q} and {v}")
        pybullet.setJointMotorControlArray(
            self.body,
            self._arm_joints,
            pybullet.POSITION_CONTROL,
            targetPositions=q.tolist(),
            targetVelocities=v.tolist(),
            forces=ROBOT.torque.tolist(),
            positionGains=[_POSITION_GAIN] * 7,
            velocityGains=[_VELOCITY_GAIN] * 7,
            physicsClientId=self._client,
        )

    def command_fingers(self, width: float, max_effort: float) -> None:
        """Drive the fingers to a full width [m], clipped to 0..the hand's opening, with at most max_effort [N] each.

        Raises:
            SimulationError: when the width or the effort is not finite.
        """
        if not (np.isfinite(width) and np.isfinite(max_effort)):
            raise SimulationError(f"a finger command needs finite numbers, got {width} m, {max_effort} N")
        half = float(np.clip(width, 0.0, HAND.opening)) / 2.0
        force = float(np.clip(max_effort, 0.0, HAND.max_force))
        for joint in self._finger_joints:
            pybullet.setJointMotorControl2(
                self.body,
                joint,
                pybullet.POSITION_CONTROL,
                targetPosition=half,
                targetVelocity=0.0,
                force=force,
                maxVelocity=_MOTOR_SPEED,
                physicsClientId=self._client,
            )

    def hold(self) -> None:
        """Stop here: the arm holds the positions that it has now."""
        self.command(self.state().positions, np.zeros(7))

    def reset_home(self) -> None:
        """Put the arm at the ready pose, at rest, with the hand open, without simulating the way there."""
        for joint, position in zip(self._arm_joints, ROBOT.ready.tolist(), strict=True):
            pybullet.resetJointState(self.body, joint, position, 0.0, physicsClientId=self._client)
        for joint in self._finger_joints:
            pybullet.resetJointState(self.body, joint, HAND.opening / 2.0, 0.0, physicsClientId=self._client)
        self.command(ROBOT.ready, np.zeros(7))
        self.command_fingers(HAND.opening, 20.0)

    def tcp_in_base(self) -> Pose:
        """Return the pose of the tcp in the base frame."""
        return self.link_pose(self._hand) @ _TCP_IN_HAND

    def link_pose(self, link: int) -> Pose:
        """Return the pose of a link's URDF frame in the base frame; link: its index, -1 for the base."""
        if link < 0:
            return Pose.identity()
        state = pybullet.getLinkState(self.body, link, computeForwardKinematics=True, physicsClientId=self._client)
        return Pose.from_quaternion_xyzw(state[5], state[4])

    def _find_links(self) -> dict[str, int]:
        count = pybullet.getNumJoints(self.body, physicsClientId=self._client)
        infos = [pybullet.getJointInfo(self.body, i, physicsClientId=self._client) for i in range(count)]
        return {info[12].decode(): info[0] for info in infos}

    def _set_up_contacts(self) -> None:
        for link in range(-1, pybullet.getNumJoints(self.body, physicsClientId=self._client)):
            pybullet.changeDynamics(
                self.body, link, linearDamping=0.0, angularDamping=0.0, physicsClientId=self._client
            )
        for joint in self._finger_joints:
            pybullet.changeDynamics(
                self.body,
                joint,
                lateralFriction=_FINGERTIP_FRICTION,
                spinningFriction=0.1,
                rollingFriction=0.001,
                frictionAnchor=True,
                physicsClientId=self._client,
            )
        gear = pybullet.createConstraint(
            self.body,
            self._finger_joints[0],
            self.body,
            self._finger_joints[1],
            jointType=pybullet.JOINT_GEAR,
            jointAxis=[1, 0, 0],
            parentFramePosition=[0, 0, 0],
            childFramePosition=[0, 0, 0],
            physicsClientId=self._client,
        )
        pybullet.changeConstraint(gear, gearRatio=-1, erp=0.1, maxForce=50, physicsClientId=self._client)
