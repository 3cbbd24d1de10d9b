"""The hand's dimensions against the boxes of the URDF that ships with the Panda."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from panda_model import load_preset
from panda_model.description import load_description

ARM = load_preset()
HAND = ARM.hand
URDF = ElementTree.fromstring(load_description(ARM).urdf)


def joint_height(name: str) -> float:
    """z of a joint's origin in its parent's frame [m]."""
    return float(URDF.find(f"joint[@name='{name}']/origin").attrib["xyz"].split()[2])


def upright_boxes(link: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """(centre, size) of a link's collision boxes that are not tilted [m], link frame."""
    found = []
    for collision in URDF.findall(f"link[@name='{link}']/collision"):
        origin, box = collision.find("origin").attrib, collision.find("geometry/box").attrib
        if set(origin["rpy"].split()) == {"0"}:
            found.append(tuple(np.array([float(v) for v in text.split()]) for text in (origin["xyz"], box["size"])))
    return found


def test_the_tcp_and_the_opening() -> None:
    assert joint_height("panda_hand_tcp_joint") == HAND.tcp_from_hand
    upper = float(URDF.find("joint[@name='panda_finger_joint1']/limit").attrib["upper"])
    assert 2.0 * upper == HAND.opening


def test_the_finger() -> None:
    boxes = upright_boxes("panda_leftfinger")
    pad, mount = max(boxes, key=lambda b: b[0][2]), max(boxes, key=lambda b: b[0][1])
    finger = joint_height("panda_finger_joint1")
    assert pad[1][1] == pytest.approx(HAND.finger_thickness)
    assert pad[1][2] == pytest.approx(HAND.pad_length)
    assert finger + pad[0][2] + pad[1][2] / 2 - HAND.tcp_from_hand == pytest.approx(HAND.fingertip_below_tcp, abs=1e-6)
    assert mount[0][1] + mount[1][1] / 2 == pytest.approx(HAND.mount_thickness)
    widths = [size[0] / 2 for _, size in (pad, mount)]
    assert min(widths) < HAND.finger_half_width < max(widths)
    top = HAND.tcp_from_hand - HAND.palm_above_tcp
    assert finger + mount[0][2] + mount[1][2] / 2 - top == pytest.approx(HAND.mount_length, abs=0.0006)


def test_the_closed_fingers_hold_their_pads() -> None:
    pad = max(upright_boxes("panda_leftfinger"), key=lambda b: b[0][2])
    assert 2 * pad[1][1] < HAND.closed_width < 2 * pad[1][1] + 0.002
    assert pad[1][0] < HAND.closed_depth < pad[1][0] + 0.001
