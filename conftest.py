"""How `make test` shares its tests between processes: a file stays in one, and so do all tests that start a graph."""

from pathlib import Path

import pytest

GRAPH_TESTS = Path(__file__).with_name("tests")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the tests across packages, which take longest, and keep them together: a graph fills a core."""
    items.sort(key=lambda item: GRAPH_TESTS not in item.path.parents)
    for item in items:
        group = "graph" if GRAPH_TESTS in item.path.parents else str(item.path)
        item.add_marker(pytest.mark.xdist_group(group))
