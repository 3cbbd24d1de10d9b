"""The table of injected faults: `python tests/fault_table.py` makes it of what tests/test_motion_faults.py found."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path

OUT = Path(__file__).resolve().parents[1] / "out" / "motion_faults.json"
_LINE = re.compile(r"\[(?P<level>\w+)\] \[[\d.]+\] \[(?P<node>panda_executor|panda_guard|sim_bridge)\]: (?P<words>.+)")
_END = re.compile(r"[A-Z_]+ after [\d.]+ s: ")  # of a goal, as the executor logs it
_PATIENCE = 4.0  # for the first line about a fault [s]
_MORE = 0.5  # for those that follow on it [s]


class FaultLog:
    """What executor, guard and simulator say from now on, in the log of a graph."""

    def __init__(self, path: Path) -> None:
        self._path, self._begin = path, len(path.read_text(errors="replace"))

    def said(self) -> str:
        """Return how the goal ended, and why everything was cancelled before, in the order in which it was said."""
        deadline = time.monotonic() + _PATIENCE
        while not self._found() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(_MORE)
        return "; ".join(self._found())

    def _found(self) -> list[str]:
        text = self._path.read_text(errors="replace")[self._begin :]
        told: dict[str, None] = {}
        for line in map(_LINE.search, text.splitlines()):
            if line is None:
                continue
            ended = _END.match(line["words"])
            if ended or line["level"] == "ERROR":
                told[f"{_NAMES[line['node']]}: {line['words']}"] = None
            if ended:  # what follows is about another goal
                break
        return list(told)


_NAMES = {"panda_executor": "executor", "panda_guard": "guard", "sim_bridge": "simulator"}


def table(found: dict[str, dict[str, float | str]]) -> str:
    """Return the table in Markdown: each fault, when the arm was at rest, its way until then, and what was said."""
    rows = ["| fault | at rest after [s] | way of the TCP [mm] | what was said |", "|---|---|---|---|"]
    for fault, row in found.items():
        seconds, millimetres = float(row["standstill_s"]), 1000.0 * float(row["way_m"])
        rows.append(f"| {fault} | {seconds:.2f} | {millimetres:.0f} | {row['words']} |")
    return "\n".join(rows)


if __name__ == "__main__":
    print(table(json.loads(OUT.read_text())))
