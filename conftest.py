"""How `make test` shares its tests between processes: a file stays in one, and so do all tests that start a graph."""

from pathlib import Path

import pytest
from xdist.scheduler import LoadScopeScheduling

PROCESSES = {"next_domain", "CHROMIUM", "Workplace"}  # a test's module has one of these where it starts nodes or a page
GRAPH_TESTS = Path(__file__).with_name("tests")
MOSTLY_WAIT = f"{GRAPH_TESTS.name}/test_ros2_"  # the tests of `ros2` leave most of a core idle


class FilesTogether(LoadScopeScheduling):
    """Hands out whole files, and to one process those of `tests/` that start graphs: a graph fills a core."""

    def _split_scope(self, nodeid: str) -> str:
        path = nodeid.split("::")[0]
        starts_graphs = path.startswith(f"{GRAPH_TESTS.name}/") and not path.startswith(MOSTLY_WAIT)
        return GRAPH_TESTS.name if starts_graphs else path


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> FilesTogether:
    """Use this way of sharing instead of xdist's own; its groups have no effect with pytest 9.2."""
    return FilesTogether(config, log)


class FailuresAtOnce:
    """Says in a line, when it happens, which test failed or is tried again, and why: a run can end without summary."""

    def __init__(self, reporter: pytest.TerminalReporter) -> None:
        self._reporter = reporter

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Called by pytest, in the process that prints, for each phase of each test."""
        if report.outcome in ("failed", "rerun"):
            what = "tried again" if report.outcome == "rerun" else "failed"
            words = str(getattr(getattr(report.longrepr, "reprcrash", None), "message", report.longrepr)).splitlines()
            self._reporter.ensure_newline()
            self._reporter.write_line(
                f"{what} after {report.duration:.0f} s: {report.nodeid}: {words[0] if words else ''}"
            )


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Watch the reports of all processes, in the one that prints."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    if reporter and not hasattr(config, "workerinput"):
        config.pluginmanager.register(FailuresAtOnce(reporter))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the tests across packages, which take longest; try again twice what leans on other processes.

    Middleware and browsers answer late on a machine that is busy with something else. The summary names what was tried
    again.
    """
    for item in items:
        if PROCESSES & vars(getattr(item, "module", None) or object).keys():
            item.add_marker(pytest.mark.flaky(reruns=2))
    items.sort(key=lambda item: GRAPH_TESTS not in item.path.parents)
