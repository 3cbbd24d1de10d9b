"""How `make test` shares its tests between processes: a file stays in one, and so do all tests that start a graph."""

from pathlib import Path

import pytest
from xdist.scheduler import LoadScopeScheduling

PROCESSES = {"next_domain", "CHROMIUM", "Workplace"}  # a test's module has one of these where it starts nodes or a page
GRAPH_TESTS = Path(__file__).with_name("tests")


class FilesTogether(LoadScopeScheduling):
    """Hands out whole files, and those of `tests/` to one process: a graph fills a core."""

    def _split_scope(self, nodeid: str) -> str:
        path = nodeid.split("::")[0]
        return GRAPH_TESTS.name if path.startswith(f"{GRAPH_TESTS.name}/") else path


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> FilesTogether:
    """Use this way of sharing instead of xdist's own; its groups have no effect with pytest 9.2."""
    return FilesTogether(config, log)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say why a test was tried again, in a line each."""
    for report in terminalreporter.getreports("rerun"):
        words = str(getattr(getattr(report.longrepr, "reprcrash", None), "message", report.longrepr))
        terminalreporter.write_line(f"tried again: {report.nodeid}: {words.partition(chr(10))[0]}")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the tests across packages, which take longest; try again twice what leans on other processes.

    Middleware and browsers answer late on a machine that is busy with something else. The summary names what was tried
    again.
    """
    for item in items:
        if PROCESSES & vars(getattr(item, "module", None) or object).keys():
            item.add_marker(pytest.mark.flaky(reruns=2))
    items.sort(key=lambda item: GRAPH_TESTS not in item.path.parents)
