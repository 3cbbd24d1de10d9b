"""The three kinds of network know what they share, and nothing of each other."""

import ast
from pathlib import Path

import pytest

import cliport_policy
from cliport_policy.card import resolve_checkpoint, shipped_names
from cliport_policy.checkpoint import ANCHORS, load_checkpoint, network_tensors
from cliport_policy.networks.compact.network import CompactNetwork
from cliport_policy.networks.factory import restore_network
from cliport_policy.networks.joint.network import JointNetwork

PACKAGE = "cliport_policy.networks"
KINDS = ("compact", "joint", "streams")
FOLDER = Path(cliport_policy.__file__).parent / "networks"


def _imports(path: Path) -> set[str]:
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return {node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module}


# The joint network is made of the compact one's goal reader, rotator and blocks.
@pytest.mark.parametrize(
    ("kind", "other"),
    [("compact", "streams"), ("compact", "joint"), ("streams", "compact"), ("streams", "joint"), ("joint", "streams")],
)
def test_one_kind_knows_nothing_of_the_other(kind: str, other: str) -> None:
    files = sorted((FOLDER / kind).glob("*.py"))
    assert files
    for path in files:
        assert not any(name.startswith(f"{PACKAGE}.{other}") for name in _imports(path)), path
        assert f"{PACKAGE}.factory" not in _imports(path), path


def test_what_all_share_knows_none_but_for_the_factory() -> None:
    knowing = set()
    for path in FOLDER.glob("*.py"):
        if any(name.startswith(tuple(f"{PACKAGE}.{kind}" for kind in KINDS)) for name in _imports(path)):
            knowing.add(path.name)
    assert knowing == {"factory.py"}


@pytest.mark.parametrize("name", shipped_names())
def test_shipped_weights_fit_the_network_that_their_name_begins_with(name: str) -> None:
    path = resolve_checkpoint(name)
    tensors, card = load_checkpoint(path)
    network = restore_network(card.network, tensors, card.frozen, path)
    assert isinstance(network, {"compact": CompactNetwork, "multi": JointNetwork}[name.partition("-")[0]])
    assert set(network.state_dict()) == set(network_tensors(tensors)) and ANCHORS in tensors


@pytest.mark.parametrize("kind", KINDS)
def test_all_kinds_are_installed(kind: str) -> None:
    assert (FOLDER / kind / "__init__.py").is_file()
