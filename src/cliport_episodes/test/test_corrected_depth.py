"""Recorded depth is what the camera measured; what is read is corrected as the setup says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.errors import SetupError
from cliport_episodes.observation import observation_from_messages
from cliport_episodes.raw import RawMessage
from cliport_perception.depth_correction import DepthCorrection

OFF = DepthCorrection(1.01, -0.004)


def test_depth_is_corrected_as_it_is_read(setup: CaptureSetup, scene: Callable[[int], list[RawMessage]]) -> None:
    as_measured = observation_from_messages(scene(0), "step 0", setup).depth_m
    corrected = observation_from_messages(scene(0), "step 0", replace(setup, depth=OFF)).depth_m
    np.testing.assert_allclose(corrected, 1.01 * as_measured - 0.004, atol=1e-6)


def test_the_setup_keeps_the_correction_and_tells_others_apart(setup: CaptureSetup) -> None:
    off = replace(setup, depth=OFF)
    assert CaptureSetup.from_dict(off.to_dict()).depth == OFF
    assert "depth" not in setup.to_dict() and CaptureSetup.from_dict(setup.to_dict()).depth.is_identity
    (words,) = off.differences(setup)
    assert words.startswith("depth is corrected by {'scale': 1.01, 'offset': -0.004} here")
    assert off.differences(replace(setup, depth=DepthCorrection(1.01001, -0.004))) == []
    with pytest.raises(SetupError, match="a depth scale must be from"):
        CaptureSetup.from_dict({**off.to_dict(), "depth": {"scale": 3.0, "offset": 0.0}})
