"""Reach and duration of a package's tests: one run of all of them under coverage."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from cosmic_ray.work_item import MutationSpec
from coverage import CoverageData

PYTEST = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:rerunfailures"]
TIMEOUT = (30.0, 4.0)  # of a mutant's tests: seconds, and times what they took without one
DEFINITIONS = "/test_values.py"  # tests that look at what modules define, without running a line of it
DURATION = re.compile(r"^ *([\d.]+)s (?:call|setup|teardown) +(.+)$", re.MULTILINE)


class Tests:
    """The package's tests: which reach a line, and how long each takes."""

    def __init__(self, package: str, folder: Path, leave_out: Sequence[str] = ()) -> None:
        self._reach, self._text = CoverageData(str(folder / "coverage")), folder / "baseline.txt"
        if not self._text.exists():
            self._measure(package, folder, leave_out)
        self._reach.read()
        said = self._text.read_text()
        self.failing = set(re.findall(r"^(?:FAILED|ERROR) (\S+::.+?)(?: - .*)?$", said, re.MULTILINE))
        self.seconds: dict[str, float] = {}
        for seconds, name in DURATION.findall(said):
            self.seconds[name] = self.seconds.get(name, 0.0) + float(seconds)
        self._starts_processes = {
            str(path) for path in (Path("src") / package / "test").glob("test_*.py") if "subprocess" in path.read_text()
        }

    def _measure(self, package: str, folder: Path, leave_out: Sequence[str]) -> None:
        print("one run of all tests under coverage ...", flush=True)
        command = [*PYTEST, f"--cov={package}", "--cov-context=test", "--cov-report=", "--durations=0", "-rfE"]
        command += ["--durations-min=0", "-vv", f"src/{package}/test"]
        command += [f"--ignore=src/{package}/test/{name}" for name in leave_out]
        environment = os.environ | {"COVERAGE_FILE": str(folder / "coverage")}
        run = subprocess.run(command, env=environment, capture_output=True, text=True)
        if run.returncode not in (0, 1):
            raise SystemExit(f"error: the tests of {package} cannot be run:\n{run.stdout[-2000:]}{run.stderr[-2000:]}")
        self._text.write_text(run.stdout)

    def reaching(self, spec: MutationSpec, budget: float) -> tuple[list[str], float]:
        """The quickest tests for a place, as many as take `budget` [s], at least one; and how long they may take [s].

        Those that run one of the lines; where none does (it runs once, on import, or in a process of its own),
        those that run anything of the module, those that start processes, and those that look at definitions.
        """
        by_line = self._reach.contexts_by_lineno(str(Path(spec.module_path).resolve()))
        lines = range(spec.start_pos[0], spec.end_pos[0] + 1)
        here = {context for line in lines for context in by_line.get(line, ())} - {""}
        anywhere = {context for contexts in by_line.values() for context in contexts} - {""}
        names = {context.rsplit("|", 1)[0] for context in here or anywhere}
        if not here:
            names |= {name for name in self.seconds if name.split("::")[0] in self._starts_processes}
            names |= {name for name in self.seconds if name.split("::")[0].endswith(DEFINITIONS)}
        chosen: list[str] = []
        spent = 0.0
        for name in sorted(names - self.failing, key=lambda name: (self.seconds.get(name, 0.0), name)):
            if chosen and spent + self.seconds.get(name, 0.0) > budget:
                break
            chosen.append(name)
            spent += self.seconds.get(name, 0.0)
        return chosen, TIMEOUT[0] + TIMEOUT[1] * spent
