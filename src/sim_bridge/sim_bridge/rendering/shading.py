"""Colours of lit surfaces by Lambert's rule: one directed light, and ambient light from above."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sim_bridge.rendering.appearance import Appearance
from sim_bridge.rendering.rays import dot


def shade(
    appearance: Appearance,
    color: npt.NDArray[np.float32],
    normal: npt.NDArray[np.float32],
    dark: npt.NDArray[np.bool_] | bool,
) -> npt.NDArray[np.uint8]:
    """Return the RGB (K, 3) that points show: their own colours (K, 3)
    0..255, normals (K, 3), dark (K,) in a shadow."""
    share = appearance.ambient * (0.85 + 0.15 * normal[:, 2])
    share += np.where(dark, 0.0, appearance.diffuse * towards_light(appearance, normal))
    shown = color * share[:, None]
    return np.clip(np.rint(shown, out=shown), 0, 255, out=shown).astype(np.uint8)


def towards_light(appearance: Appearance, normal: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return the cosine (K,) between normals (K, 3) and the light, 0 where they face away."""
    return np.maximum(dot(normal, np.array(appearance.to_light, dtype=np.float32)), np.float32(0.0))
