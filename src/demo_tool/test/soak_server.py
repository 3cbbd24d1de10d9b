"""A served workplace in a process of its own, which a soak test drives by lines: one in, one out, both JSON.

    python soak_server.py FOLDER TOKEN

["state", NAME] puts the station in a state of the page, ["rest"] in the state ready; ["stops"] answers with the times
at which the arm was told to stop [s, the machine's steady clock]; ["memory"] with what the process holds [MB].
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from web_workplace import Workplace, workplace

from cliport_core.outcome import ActionResult, Outcome
from cliport_core.policy_state import PolicyState, ServerStatus
from demo_tool.station_config import StationConfig

LONG = 3600.0  # s; what is begun goes on until it is stopped
AWAY = {"panda_joint4": 0.3}  # rad, from the ready pose
DONE = ActionResult(Outcome.SUCCEEDED, "done", (0.42, -0.12, 0.03), 0.04)


class Soaked:
    """The workplace, and how it gets into each state."""

    def __init__(self, place: Workplace) -> None:
        self.place, self.stops = place, list[float]()
        self._writing = threading.Event()  # set: the disk writes
        self._writing.set()
        self._instruct = place.policy.instruct
        stop, add_step = place.arm.stop, place.station._recorder.add_step

        def timed_stop(*arguments: Any) -> None:
            self.stops.append(time.monotonic())
            stop(*arguments)

        def slow_step(*arguments: Any) -> None:
            self._writing.wait()
            add_step(*arguments)

        place.arm.stop = timed_stop  # type: ignore[method-assign]
        place.station._recorder.add_step = slow_step  # type: ignore[method-assign]

    def rest(self) -> None:
        """Get back to the state ready."""
        self._writing.set()
        place = self.place
        place.dark.clear()
        place.policy.instruct = self._instruct  # type: ignore[method-assign]
        place.arm.pace, place.arm.waiting_plan, place.arm.result = 0.01, "", DONE
        place.station.command("stop", {})
        self._until(lambda: "still" not in place.station.view(None)["words"])
        place.station.on_joints({})
        place.station.command("resume", {})
        if place.station.view(None)["state"] == "failed":
            place.station.command("clear", {})
            self._draw()
            place.station.command("execute", {})
        place.wait_for("ready")

    def bring_about(self, state: str) -> None:
        """Bring a state about."""
        place = self.place
        self._draw()
        getattr(self, f"_{state}")()
        place.wait_for(state)

    def _draw(self) -> None:
        self.place.draw("pick", self.place.table.box_around(self.place.table.blocks[0]))
        self.place.draw("place", self.place.table.box_at(0.5, -0.02))

    def _ready(self) -> None:
        """Nothing is to be done."""

    def _waiting_for_camera(self) -> None:
        self.place.dark.set()
        self._until(lambda: self.place.station.view(None)["state"] == "stale")
        self.place.station._watch.view = None

    def _stale(self) -> None:
        self.place.dark.set()

    def _planning(self) -> None:
        self.place.arm.pace = LONG
        self.place.station.command("preview", {})

    def _executing(self) -> None:
        self.place.arm.pace = 0.3
        self.place.station.command("execute", {})
        self.place.wait_for("executing")
        self.place.arm.pace = LONG

    def _waiting_for_approval(self) -> None:
        self.place.arm.waiting_plan = "12ab34cd"
        self.place.station.command("execute", {})

    def _recovering(self) -> None:
        home = StationConfig().home
        self.place.station.on_joints({name: value + AWAY.get(name, 0.0) for name, value in home.items()})
        self.place.arm.pace = LONG
        self.place.station.command("recover", {})

    def _recording(self) -> None:
        self._writing.clear()
        threading.Thread(target=self.place.station.command, args=("record", {}), daemon=True).start()

    def _proposing(self) -> None:
        def look(text: str) -> None:
            status = PolicyState.PROPOSING if text else PolicyState.IDLE
            self.place.policy.on_status(ServerStatus(status, "choosing", text))

        self.place.policy.instruct = look  # type: ignore[method-assign]
        self.place.station.command("propose", {})

    def _failed(self) -> None:
        self.place.arm.result = ActionResult(Outcome.PLANNING_FAILED, "no way was found")
        self.place.station.command("execute", {})

    def _stopped(self) -> None:
        self.place.station.command("stop", {})

    @staticmethod
    def _until(holds: Callable[[], bool]) -> None:
        end = time.monotonic() + 60.0
        while not holds():
            assert time.monotonic() < end, "it does not come to rest"
            time.sleep(0.01)


def resident_mb() -> float:
    """Return what this process holds in memory [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGESIZE") / 1e6


def main() -> None:
    """Serve until the standard input ends."""
    with workplace(Path(sys.argv[1]), token=sys.argv[2], host="0.0.0.0", pace=0.01) as place:
        soaked = Soaked(place)
        print(json.dumps([place.port, place.rule.cookie()]), flush=True)
        for line in sys.stdin:
            name, *arguments = json.loads(line)
            answer: Any = None
            if name == "state":
                soaked.bring_about(*arguments)
            elif name == "rest":
                soaked.rest()
            elif name == "stops":
                answer = soaked.stops
            elif name == "memory":
                answer = resident_mb()
            print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
