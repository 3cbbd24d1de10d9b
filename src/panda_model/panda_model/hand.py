"""The hand: its dimensions, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class HandModel:
    """Dimensions of a parallel gripper [m] in the tcp frame: z out of the hand, y the closing direction, x across it.

    Each field is explained in the hand's YAML file, `presets/hands/franka_hand.yaml`.
    """

    opening: float
    tcp_from_hand: float
    fingertip_below_tcp: float
    finger_half_width: float
    finger_thickness: float
    pad_length: float
    mount_thickness: float
    mount_length: float
    palm_above_tcp: float
    palm_half_length: float
    palm_half_width: float
    housing_top: float
    flange_half_width: float
    flange_length: float
    closed_width: float
    closed_depth: float
    finger_slack: float
    fold_opening: float
    speed: float
    max_force: float
    allowed_force: float

    @property
    def finger_width(self) -> float:
        """Width of a finger across the closing direction [m]."""
        return 2.0 * self.finger_half_width

    @property
    def finger_length(self) -> float:
        """Length of a finger from its tip to the palm [m]."""
        return self.fingertip_below_tcp + self.palm_above_tcp

    @property
    def mount_above_tcp(self) -> float:
        """Height of the underside of a finger's mount above the tcp [m]."""
        return self.palm_above_tcp - self.mount_length

    @property
    def widest(self) -> float:
        """Width of the widest thing that the opened fingers go round [m]."""
        return self.opening - 2.0 * self.finger_slack
