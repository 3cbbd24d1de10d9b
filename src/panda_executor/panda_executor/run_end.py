"""The end of a run in words, whatever ends it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from cliport_core.outcome import ActionResult, Outcome
from panda_executor.errors import ExecutorError, GraspError, PlanningError, RequestError
from panda_executor.run_commands import EarlyEnd, RunCommands

Recover = Callable[[EarlyEnd], ActionResult]


def ended(commands: RunCommands, act: Callable[[], str], success: Outcome, recover: Recover) -> ActionResult:
    """Return how `act` ended, which returns a sentence when it went well.

    recover: of a run that was cut short, its end.
    """
    try:
        return result_of(commands, success, act())
    except EarlyEnd as end:
        return recover(end)
    except RequestError as error:
        if commands.should_stop():  # it ended a wait for what the request lacks
            return result_of(commands, Outcome.CANCELLED, f"cancelled; {_what_moved(commands)}: {error}")
        refused = result_of(commands, Outcome.REJECTED, str(error))
        return replace(refused, refusal=error.refusal, refusal_value=error.value, refusal_limit=error.limit)
    except (GraspError, PlanningError) as error:
        if commands.should_stop():
            return result_of(commands, Outcome.CANCELLED, f"cancelled during planning; {_what_moved(commands)}")
        return result_of(commands, Outcome.PLANNING_FAILED, str(error))
    except ExecutorError as error:
        return result_of(commands, Outcome.EXECUTION_FAILED, str(error))


def result_of(commands: RunCommands, outcome: Outcome, message: str) -> ActionResult:
    """Return a run's end with the fingers' distance, NaN where the gripper does not say it."""
    try:
        width = commands.width()
    except ExecutorError:
        width = float("nan")
    return ActionResult(outcome, message, gripper_width=width)


def _what_moved(commands: RunCommands) -> str:
    return "the arm holds" if commands.moved else "nothing moved"
