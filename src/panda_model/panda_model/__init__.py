"""The arm and the hand, stated once: names, limits, frames, URDF, geometry and controllers of each preset."""

from panda_model.arm import ArmModel, Description
from panda_model.errors import PresetError
from panda_model.hand import HandModel
from panda_model.limits import ARM_DOF, FloatArray, JointLimits
from panda_model.preset_files import DEFAULT_PRESET, load_preset, preset_names

__all__ = [
    "ARM_DOF",
    "DEFAULT_PRESET",
    "ArmModel",
    "Description",
    "FloatArray",
    "HandModel",
    "JointLimits",
    "PresetError",
    "load_preset",
    "preset_names",
]
