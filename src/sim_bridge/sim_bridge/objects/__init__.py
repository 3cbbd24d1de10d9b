"""Things that tasks put on the table, one file for each kind, and their common types."""

from __future__ import annotations

from sim_bridge.objects.block import block_shape, cuboid
from sim_bridge.objects.bowl import bowl_shape
from sim_bridge.objects.collision import BoxPart, Collision, CylinderPart, HullPart
from sim_bridge.objects.container import container_shape
from sim_bridge.objects.shape import Pinch, SceneObject, Shape

__all__ = [
    "BoxPart",
    "Collision",
    "CylinderPart",
    "HullPart",
    "Pinch",
    "SceneObject",
    "Shape",
    "block_shape",
    "bowl_shape",
    "container_shape",
    "cuboid",
]
