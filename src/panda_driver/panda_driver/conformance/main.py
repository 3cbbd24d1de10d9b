"""The executable `conformance`: tests the arm that runs, a line for each check; moves it by a few degrees."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import rclpy
from rclpy.node import Node
from rclpy.utilities import remove_ros_args

from cliport_core.command_line import CommandParser
from cliport_core.errors import CoreError
from cliport_core.ros_running import SpinThread
from panda_driver.conformance.checks import CHECKS, Check, CheckFailedError
from panda_driver.conformance.node_client import ArmClient
from panda_driver.conformance.subject import Bounds, Subject
from panda_driver.errors import DriverError
from panda_model import DEFAULT_PRESET, load_preset

_FORMAT = 1  # of the JSON file
_DISCOVERY = 20.0  # for the arm to be found [s]
_SETTLE = 10.0  # for the arm to be at rest between two checks [s]


@dataclass(frozen=True)
class Outcome:
    """Finding of one check."""

    name: str
    passed: bool
    line: str


def run_checks(subject: Subject, checks: Sequence[Check], say: Callable[[str], None]) -> list[Outcome]:
    """Run checks one after the other, each with the arm at rest; say a line for each."""
    outcomes = []
    for check in checks:
        _settle(subject)
        try:
            outcome = Outcome(check.name, True, check.run(subject))
        except CheckFailedError as error:
            outcome = Outcome(check.name, False, str(error))
        outcomes.append(outcome)
        say(f"{'ok  ' if outcome.passed else 'FAIL'}  {outcome.name:18} {outcome.line}")
    return outcomes


def _settle(subject: Subject) -> None:
    """Wait until the arm has stood still for a moment; not for ever."""

    def rests() -> bool:
        samples = subject.samples(subject.now() - 0.3)
        return len(samples) > 2 and abs(samples[-1].arm - samples[0].arm).max() < subject.bounds.still / 4.0

    subject.wait(rests, _SETTLE)


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="conformance",
        description="Tests the arm whose driver runs. IT MOVES: each joint by a few degrees, and the fingers.",
    )
    parser.add_argument("--arm", default=DEFAULT_PRESET, help="preset's name or file (default %(default)s)")
    parser.add_argument(
        "--only", nargs="+", metavar="CHECK", choices=[check.name for check in CHECKS], help="these alone"
    )
    parser.add_argument("--no-hand", action="store_true", help="leave the checks of the hand out")
    parser.add_argument("--out", metavar="FILE", help="write what was found as JSON")
    standard = Bounds()
    for field in fields(Bounds):
        parser.add_argument(
            f"--{field.name}", type=float, default=getattr(standard, field.name), help="default %(default)g"
        )
    return parser


def main(args: list[str] | None = None) -> int:
    """Run the checks; return 0 when it passed, 1 when it failed a check, 2 when it could not be tested."""
    given = sys.argv if args is None else ["conformance", *args]
    options = _parser().parse_args(remove_ros_args(given)[1:])
    try:
        robot = load_preset(options.arm)
        bounds = Bounds(**{field.name: getattr(options, field.name) for field in fields(Bounds)})
        chosen = _chosen(options.only, options.no_hand)
        if not chosen:
            raise DriverError("--no-hand leaves none of the checks that --only names")
        rclpy.init(args=given)
        node = Node("panda_conformance")
        failures: list[BaseException] = []
        spinner = SpinThread(node, failures.append)
        try:
            client = ArmClient(node, robot, bounds)
            if missing := client.missing(_DISCOVERY, not options.no_hand):
                raise DriverError(
                    f"the {robot.name} is not there: nothing at {', '.join(missing)}; is its driver started?"
                )
            outcomes = run_checks(client, chosen, print)
        finally:
            spinner.stop()
            node.destroy_node()
            rclpy.try_shutdown()
        if options.out:
            _write(Path(options.out), robot.name, bounds, outcomes)
    except CoreError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    failed = [outcome.name for outcome in outcomes if not outcome.passed]
    print(
        f"{len(outcomes) - len(failed)} of {len(outcomes)} checks passed"
        + (f": not {', '.join(failed)}" if failed else "")
    )
    return 1 if failed else 0


def _chosen(names: Sequence[str] | None, no_hand: bool) -> list[Check]:
    return [check for check in CHECKS if (not names or check.name in names) and not (no_hand and check.for_hand)]


def _write(path: Path, arm: str, bounds: Bounds, outcomes: Sequence[Outcome]) -> None:
    """Write a JSON object: format, arm, bounds, passed, checks. Raises DriverError when that cannot be."""
    content = {
        "format": _FORMAT,
        "arm": arm,
        "bounds": vars(bounds),
        "passed": all(outcome.passed for outcome in outcomes),
        "checks": [vars(outcome) for outcome in outcomes],
    }
    try:
        path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise DriverError(f"cannot write {path}: {error.strerror}") from None


if __name__ == "__main__":
    sys.exit(main())
