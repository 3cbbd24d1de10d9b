"""Everyday objects of the packing tasks: the project's own, or Google Scanned Objects from a folder."""

from __future__ import annotations

from sim_bridge.everyday.everyday_object import EverydayObject
from sim_bridge.everyday.object_set import FOLDER_VARIABLE, ObjectSet, describe, object_set

__all__ = ["FOLDER_VARIABLE", "EverydayObject", "ObjectSet", "describe", "object_set"]
