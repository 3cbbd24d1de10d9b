"""The URDF and SRDF of an arm, found on disk: those that its preset names, or the user's own."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path

from panda_model.arm import ArmModel
from panda_model.errors import DescriptionError

OWN = "own"
_RELATIVE_MESH = re.compile(r'filename="(?!/|[a-z]+:)')


@dataclass(frozen=True)
class RobotDescription:
    """An arm's URDF and SRDF.

    urdf, srdf: XML. package_folders: in which `package://` begins. prefix: the beginning of the names in both.
    notice: what a user should be told of them; empty for nothing.
    """

    urdf: str = field(repr=False)
    srdf: str = field(repr=False)
    package_folders: tuple[str, ...]
    prefix: str
    notice: str = ""


def load_description(arm: ArmModel, given: str = "") -> RobotDescription:
    """Return the description of an arm.

    Args:
        given: the user's own URDF, as the path of a file or as XML; its names must begin as the preset's frames do, and
            meshes without a scheme lie relative to the file. Empty: the one that the preset names. OWN: the arm's own,
            from the package that the preset names for it.

    Raises:
        DescriptionError: when a file or a package is missing, or the URDF's names do not fit the preset.
    """
    named = arm.description
    share = _share_of(named.package, named.urdf)
    srdf = _text(share / named.package / named.srdf)
    if not given:
        urdf = _text(share / named.package / named.urdf)
        notice = f"preset {arm.name} {named.notice}" if named.notice else ""
        return RobotDescription(urdf, srdf, (str(share),), named.prefix, notice)
    urdf = given if given.lstrip().startswith("<") else _urdf_of(_own_urdf(arm) if given == OWN else Path(given))
    for frame in (f"{arm.prefix}link0", arm.hand_frame, arm.tcp_frame):
        if f'"{frame}"' not in urdf:
            raise DescriptionError(
                f"robot_description has no link '{frame}', which preset '{arm.name}' names; "
                "give a URDF of this arm with its hand, or another preset"
            )
    folders = tuple(str(folder) for folder in _share_folders())
    # which links may touch each other is the same for either arm, but for the names
    return RobotDescription(urdf, srdf.replace(named.prefix, arm.prefix), folders, arm.prefix)


def _own_urdf(arm: ArmModel) -> Path:
    """Return the path of the arm's own URDF in the package that the preset names for it."""
    package, _, file = arm.description.own.partition(":")
    if not package:
        raise DescriptionError(f"preset {arm.name} names no package with a URDF of its own: give the path of one")
    try:
        return Path(str(metadata.distribution(package).locate_file(file)))
    except metadata.PackageNotFoundError:
        raise DescriptionError(
            f"the package '{package}', which has the URDF of preset {arm.name}, is not installed"
        ) from None


def _urdf_of(path: Path) -> str:
    """Return the text of a URDF whose meshes are named by whole paths."""
    return _RELATIVE_MESH.sub(f'filename="{path.resolve().parent}/', _text(path))


def _share_of(package: str, file: str) -> Path:
    """Return the folder in which a package's folder is."""
    candidates = _share_folders()
    try:
        distribution = metadata.distribution(package)
        candidates.insert(0, Path(str(distribution.locate_file("cmeel.prefix/share"))))
    except metadata.PackageNotFoundError:
        pass
    for share in candidates:
        if (share / package / file).is_file():
            return share
    raise DescriptionError(f"no robot description found; install the package '{package}'")


def _share_folders() -> list[Path]:
    return [Path(prefix) / "share" for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if prefix]


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise DescriptionError(f"cannot read the robot description {path}: {error}") from None
