"""Definitions that no function runs."""

from value_types import complaints

from panda_driver.conformance.subject import Bounds
from panda_driver.franky_ports import ArmSettings


def test_dataclasses_are_values() -> None:
    assert complaints("panda_driver", mutable={"RunningMotion"}) == []


def test_what_counts_as_right_and_how_soft_the_arm_is() -> None:
    """Reports of arms are compared by these, and a person trusts them with their hand."""
    assert Bounds() == Bounds(25.0, 0.25, 0.02, 1.5, 1.0, 1.0, 0.25, 0.004, 0.004, 2.0, 0.08)
    stiffness = (600.0, 600.0, 600.0, 600.0, 250.0, 150.0, 50.0)
    assert ArmSettings() == ArmSettings(40.0, 40.0, 0.0, (0.0, 0.0, 0.0), stiffness, True)
