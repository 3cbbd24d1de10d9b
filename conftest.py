"""How `make test` shares its tests between processes: a file stays in one, and so do all tests that start a graph."""

import re
from pathlib import Path

import pytest
from xdist.scheduler import LoadScopeScheduling
from xdist.workermanage import WorkerController

PROCESSES = {"next_domain", "CHROMIUM", "Workplace"}  # a test's module has one of these where it starts nodes or a page
GRAPH_TESTS = Path(__file__).with_name("tests")
# Those of `ros2`, of nodes and of what joins them wait much of the time for middleware.
MOSTLY_WAIT = re.compile(r"(.*/)?test_(ros2?_\w+|\w*nodes?(_process)?|graph_\w+|conformance|killed_recorder)\.py")


class FilesTogether(LoadScopeScheduling):
    """Hands out whole files, and to one process those of `tests/` that start graphs: a graph fills a core.

    The last of three or more processes has what mostly waits, and something else only where nothing waits.
    """

    def _split_scope(self, nodeid: str) -> str:
        path = nodeid.split("::")[0]
        starts_graphs = path.startswith(f"{GRAPH_TESTS.name}/") and not MOSTLY_WAIT.fullmatch(path)
        return GRAPH_TESTS.name if starts_graphs else path

    def _reschedule(self, node: WorkerController) -> None:
        """Give a process more work, or end it where there is none for it."""
        if self._is_for_waits(node) and not any(map(MOSTLY_WAIT.fullmatch, self.workqueue)):
            if not node.shutting_down:
                node.shutdown()  # after what it was given
            return
        super()._reschedule(node)

    def _assign_work_unit(self, node: WorkerController) -> None:
        """Give a process the first work that is for it; what mostly waits to the others only when all else is done."""
        waits = self._is_for_waits(node)
        fitting = (scope for scope in self.workqueue if bool(MOSTLY_WAIT.fullmatch(scope)) == waits)
        if (scope := next(fitting, None)) is not None:
            self.workqueue.move_to_end(scope, last=False)
        super()._assign_work_unit(node)

    def _is_for_waits(self, node: WorkerController) -> bool:
        return self.numnodes >= 3 and node.gateway.id == f"gw{self.numnodes - 1}"


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> FilesTogether:
    """Use this way of sharing instead of xdist's own; its groups have no effect with pytest 9.2."""
    return FilesTogether(config, log)


def _parts(path: Path) -> list[Path]:
    """Return the folders in a folder that holds no modules, as that of the packages; of anything else itself."""
    folders = sorted(inner for inner in path.glob("*") if inner.is_dir())
    return [path] if any(path.glob("*.py")) else folders or [path]


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
    """Watch the reports of all processes, in the one that prints; let each of the others begin elsewhere."""
    if worker := getattr(config, "workerinput", None):
        folders = [str(folder) for path in config.args for folder in _parts(Path(path))]
        first = int(worker["workerid"].removeprefix("gw")) * len(folders) // worker["workercount"]
        config.args[:] = folders[first:] + folders[:first]  # what one compiles the others then find compiled
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
    items.sort(key=lambda item: (GRAPH_TESTS not in item.path.parents, item.path))
