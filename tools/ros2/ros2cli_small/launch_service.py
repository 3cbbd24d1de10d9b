"""Runs the processes of a launch description until they end or are told to."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

import yaml

from ros2cli_small.launch_file import ProcessPlan

READ_SIZE = 1 << 16
PIPE_GRACE = 1.0  # s; a grandchild may keep a pipe open after its parent's end


class LaunchLog:
    """Lines to the screen and to the launch's log file."""

    def __init__(self, file: TextIO) -> None:
        self._file = file

    def say(self, level: str, name: str, text: str) -> None:
        """A line of the launch itself."""
        self.line(f"[{level}] [{name}]: {text}", screen=True)

    def line(self, text: str, screen: bool) -> None:
        """A line of a process."""
        self._file.write(text + "\n")
        self._file.flush()
        if screen:
            print(text, flush=True)


@dataclass
class _Running:
    plan: ProcessPlan
    name: str
    process: asyncio.subprocess.Process | None = None
    finished: asyncio.Event = field(default_factory=asyncio.Event)


class LaunchService:
    """Starts all processes, passes their output on, and ends them together.

    With `signal_children` Ctrl-C is passed on to them; on a terminal they get it themselves.
    """

    def __init__(self, plans: list[ProcessPlan], log: LaunchLog, signal_children: bool) -> None:
        self._log = log
        self._signal_children = signal_children
        self._all = [_Running(plan, f"{plan.label}-{number}") for number, plan in enumerate(plans, start=1)]
        self._shutdown: asyncio.Event
        self._send_interrupt = True
        self._interrupted = False

    async def run(self) -> None:
        """Return when every process has ended."""
        self._shutdown = asyncio.Event()
        loop = asyncio.get_running_loop()
        loop.add_signal_handler(signal.SIGINT, self._on_interrupt)
        for number in (signal.SIGTERM, signal.SIGQUIT, signal.SIGHUP):
            loop.add_signal_handler(number, self._on_terminate, number)
        with tempfile.TemporaryDirectory(prefix="launch_params_") as folder:
            watchers = [asyncio.create_task(self._keep_running(one, Path(folder))) for one in self._all]
            enders = [asyncio.create_task(self._end_on_shutdown(one)) for one in self._all]
            await asyncio.gather(*watchers)
            self._shutdown.set()
            await asyncio.gather(*enders)

    def _on_interrupt(self) -> None:
        again = " again, ignoring..." if self._interrupted else ""
        self._log.say("WARNING", "launch", f"user interrupted with ctrl-c (SIGINT){again}")
        if not self._interrupted:
            self._interrupted = True
            self._send_interrupt = self._signal_children
            self._shutdown.set()

    def _on_terminate(self, number: int) -> None:
        self._log.say("WARNING", "launch", f"terminated by {signal.Signals(number).name}, shutting down")
        self._shutdown.set()

    async def _keep_running(self, one: _Running, folder: Path) -> None:
        command = [*one.plan.command, *_parameter_arguments(one, folder)]
        while not self._shutdown.is_set():
            await self._run_once(one, command)
            if one.plan.shutdown_on_exit:
                self._shutdown.set()
            if not one.plan.respawn or self._shutdown.is_set():
                break
            try:
                await asyncio.wait_for(self._shutdown.wait(), one.plan.respawn_delay)
            except (asyncio.TimeoutError, TimeoutError):
                continue
        one.finished.set()

    async def _run_once(self, one: _Running, command: list[str]) -> None:
        try:
            one.process = await asyncio.create_subprocess_exec(
                *command,
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.PIPE,
                env={**os.environ, **one.plan.environment},
                cwd=one.plan.cwd,
            )
        except OSError as error:
            self._log.say("ERROR", one.name, f"exception occurred while executing process: {error}")
            return
        process = one.process
        self._log.say("INFO", one.name, f"process started with pid [{process.pid}]")
        readers = [
            asyncio.create_task(self._pass_on(process.stdout, one.name, one.plan.output not in ("log", "own_log"))),
            asyncio.create_task(self._pass_on(process.stderr, one.name, one.plan.output != "own_log")),
        ]
        code = await process.wait()
        _, unfinished = await asyncio.wait(readers, timeout=PIPE_GRACE)
        for reader in unfinished:
            reader.cancel()
        if code == 0:
            self._log.say("INFO", one.name, f"process has finished cleanly [pid {process.pid}]")
        else:
            text = f"process has died [pid {process.pid}, exit code {code}, cmd '{' '.join(command)}']."
            self._log.say("ERROR", one.name, text)

    async def _pass_on(self, stream: asyncio.StreamReader | None, name: str, screen: bool) -> None:
        assert stream is not None
        rest = b""
        while chunk := await stream.read(READ_SIZE):
            *lines, rest = (rest + chunk).split(b"\n")
            for line in lines:
                self._log.line(f"[{name}] {line.decode(errors='replace')}", screen)
        if rest:
            self._log.line(f"[{name}] {rest.decode(errors='replace')}", screen)

    async def _end_on_shutdown(self, one: _Running) -> None:
        await self._shutdown.wait()
        if one.finished.is_set():
            return
        if self._send_interrupt:
            self._send(one, signal.SIGINT)
        waited = 0.0
        for timeout, last, following in (
            (one.plan.sigterm_timeout, signal.SIGINT, signal.SIGTERM),
            (one.plan.sigkill_timeout, signal.SIGTERM, signal.SIGKILL),
        ):
            try:
                await asyncio.wait_for(one.finished.wait(), timeout)
                return
            except (asyncio.TimeoutError, TimeoutError):
                waited += timeout
                self._log.say(
                    "ERROR",
                    one.name,
                    f"process[{one.name}] failed to terminate '{waited:g}' seconds after receiving "
                    f"'{last.name}', escalating to '{following.name}'",
                )
                self._send(one, following)
        await one.finished.wait()

    def _send(self, one: _Running, number: signal.Signals) -> None:
        if one.process is None or one.process.returncode is not None:
            return
        self._log.say("INFO", one.name, f"sending signal '{number.name}' to process[{one.name}]")
        try:
            one.process.send_signal(number)
        except ProcessLookupError:
            print(f"process[{one.name}] has ended already", file=sys.stderr)


def _parameter_arguments(one: _Running, folder: Path) -> list[str]:
    """Write the parameters to files, in their order, and return the arguments that name them."""
    arguments: list[str] = []
    for number, values in enumerate(one.plan.parameters):
        if isinstance(values, str):
            arguments += ["--params-file", values]
            continue
        file = folder / f"{one.name}-{number}.yaml"
        file.write_text(yaml.safe_dump({"/**": {"ros__parameters": values}}, allow_unicode=True))
        arguments += ["--params-file", str(file)]
    return arguments
