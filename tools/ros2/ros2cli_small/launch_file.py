"""YAML launch files: what they declare and which processes they ask for. Nothing is started here."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from ros2cli_small.errors import CommandError
from ros2cli_small.packages import find_executable
from ros2cli_small.substitutions import Scope, as_bool, substitute

OUTPUTS = ("screen", "log", "both", "own_log", "full")
_CONDITIONS = {"if", "unless"}
_PROCESS_KEYS = _CONDITIONS | {
    "name", "output", "env", "respawn", "respawn_delay", "on_exit", "launch-prefix", "cwd", "emulate_tty",
    "sigterm_timeout", "sigkill_timeout",
}  # fmt: skip
_KEYS = {
    "arg": {"name", "default", "description", "choice"},
    "let": _CONDITIONS | {"name", "value"},
    "set_env": _CONDITIONS | {"name", "value"},
    "include": _CONDITIONS | {"file", "arg", "let"},
    "push_ros_namespace": _CONDITIONS | {"namespace"},
    "node": _PROCESS_KEYS | {"pkg", "exec", "namespace", "args", "ros_args", "param", "remap"},
    "executable": _PROCESS_KEYS | {"cmd"},
}


@dataclass(frozen=True)
class Argument:
    """A declared launch argument."""

    name: str
    default: str | None
    description: str
    choices: tuple[str, ...]


@dataclass(frozen=True)
class ProcessPlan:
    """A process to start. `parameters` go to a file that is named on its command line."""

    label: str
    command: tuple[str, ...]
    output: str = "log"
    environment: dict[str, str] = field(default_factory=dict)
    parameters: tuple[dict[str, Any] | str, ...] = ()
    cwd: str | None = None
    respawn: bool = False
    respawn_delay: float = 0.0
    shutdown_on_exit: bool = False
    sigterm_timeout: float = 5.0
    sigkill_timeout: float = 5.0


class LaunchDescription:
    """Reads launch files, one after another into one list of arguments and processes.

    With `declarations_only` conditions and required arguments are passed over: for showing the arguments.
    """

    def __init__(self, configurations: dict[str, str], declarations_only: bool = False) -> None:
        self.arguments: list[Argument] = []
        self.processes: list[ProcessPlan] = []
        self._configurations = dict(configurations)
        self._environment: dict[str, str] = {}
        self._namespace = ""
        self._declarations_only = declarations_only

    def load(self, path: Path) -> None:
        """Read a file. Raises CommandError that names the file for what cannot be understood."""
        try:
            content = yaml.safe_load(path.read_text())
        except (OSError, yaml.YAMLError, UnicodeDecodeError) as error:
            raise CommandError(f"{path}: {' '.join(str(error).split())}") from None
        if not isinstance(content, dict) or set(content) != {"launch"} or not isinstance(content["launch"], list):
            raise CommandError(f"{path}: a launch file has one list, 'launch:'")
        try:
            self._read(content["launch"], path)
        except CommandError as error:
            text = str(error)
            raise CommandError(text if text.startswith("/") else f"{path}: {text}") from None

    def _read(self, entities: list[Any], path: Path) -> None:
        for entity in entities:
            if not isinstance(entity, dict) or len(entity) != 1:
                raise CommandError(f"an entry is one 'kind: attributes', not {entity!r}")
            ((kind, attributes),) = entity.items()
            kind = kind.replace("push-ros-namespace", "push_ros_namespace")
            if kind == "group":
                self._read_group(attributes, path)
                continue
            if kind not in _KEYS:
                known = ", ".join(sorted([*_KEYS, "group"]))
                raise CommandError(f"Unrecognized entity of the type: {kind} (known here: {known})")
            if not isinstance(attributes, dict):
                raise CommandError(f"attributes of '{kind}' are 'key: value' lines, not {attributes!r}")
            unknown = set(attributes) - _KEYS[kind]
            if unknown:
                raise CommandError(f"Unexpected attribute(s) found in `{kind}`: {', '.join(sorted(map(str, unknown)))}")
            if self._wanted(attributes, path):
                getattr(self, f"_read_{kind}")(attributes, path)

    def _read_group(self, entities: Any, path: Path) -> None:
        """What a group sets holds inside it only."""
        if not isinstance(entities, list):
            raise CommandError("a group is a list of entries")
        saved = dict(self._configurations), dict(self._environment), self._namespace
        self._read(entities, path)
        self._configurations, self._environment, self._namespace = saved

    def _text(self, value: Any, path: Path) -> str:
        if isinstance(value, bool):
            return str(value).lower()
        return substitute(str(value), Scope(self._configurations, path))

    def _required(self, attributes: dict[str, Any], key: str, path: Path) -> str:
        if key not in attributes:
            raise CommandError(f"attribute '{key}' is missing in {attributes!r}")
        return self._text(attributes[key], path)

    def _wanted(self, attributes: dict[str, Any], path: Path) -> bool:
        if self._declarations_only:
            return True
        if "if" in attributes and not as_bool(self._text(attributes["if"], path)):
            return False
        return not ("unless" in attributes and as_bool(self._text(attributes["unless"], path)))

    def _read_arg(self, attributes: dict[str, Any], path: Path) -> None:
        name = self._required(attributes, "name", path)
        default = self._text(attributes["default"], path) if "default" in attributes else None
        choices = tuple(self._text(choice["value"], path) for choice in attributes.get("choice", []))
        self.arguments.append(Argument(name, default, str(attributes.get("description", "")), choices))
        if name not in self._configurations:
            if default is None and not self._declarations_only:
                raise CommandError(
                    f"Included launch description missing required argument '{name}' "
                    f"(description: '{attributes.get('description', 'no description given')}')"
                )
            self._configurations[name] = default or ""
        value = self._configurations[name]
        if choices and value not in choices and not self._declarations_only:
            raise CommandError(
                f"Argument '{name}' provided value '{value}' is not valid. Valid options are: {list(choices)}"
            )

    def _read_let(self, attributes: dict[str, Any], path: Path) -> None:
        self._configurations[self._required(attributes, "name", path)] = self._required(attributes, "value", path)

    def _read_set_env(self, attributes: dict[str, Any], path: Path) -> None:
        self._environment[self._required(attributes, "name", path)] = self._required(attributes, "value", path)

    def _read_push_ros_namespace(self, attributes: dict[str, Any], path: Path) -> None:
        self._namespace = _joined(self._namespace, self._required(attributes, "namespace", path))

    def _read_include(self, attributes: dict[str, Any], path: Path) -> None:
        for argument in [*attributes.get("arg", []), *attributes.get("let", [])]:
            self._read_let(argument, path)
        self.load(Path(self._required(attributes, "file", path)).absolute())

    def _read_executable(self, attributes: dict[str, Any], path: Path) -> None:
        command = shlex.split(self._required(attributes, "cmd", path))
        self._add_process(attributes, path, command, label=Path(command[0]).name if command else "")

    def _read_node(self, attributes: dict[str, Any], path: Path) -> None:
        package, executable = (
            self._required(attributes, "pkg", path),
            self._required(attributes, "exec", path),
        )
        if self._declarations_only:
            return
        try:
            command = [str(find_executable(package, executable))]
        except CommandError as error:
            raise CommandError(f"node '{package}/{executable}': {error}") from None
        command += shlex.split(self._text(attributes.get("args", ""), path))
        ros_arguments = shlex.split(self._text(attributes.get("ros_args", ""), path))
        if "name" in attributes:
            ros_arguments += ["-r", f"__node:={self._text(attributes['name'], path)}"]
        namespace = _joined(self._namespace, self._text(attributes.get("namespace", ""), path))
        if namespace:
            ros_arguments += ["-r", f"__ns:={namespace}"]
        for remap in attributes.get("remap", []):
            ros_arguments += [
                "-r",
                f"{self._required(remap, 'from', path)}:={self._required(remap, 'to', path)}",
            ]
        command += ["--ros-args", *ros_arguments]
        self._add_process(attributes, path, command, executable, tuple(self._parameters(attributes, path)))

    def _parameters(self, attributes: dict[str, Any], path: Path) -> list[dict[str, Any] | str]:
        sets: list[dict[str, Any] | str] = []
        for param in attributes.get("param", []):
            unknown = set(param) - {"name", "value", "from", "type", "param", "sep", "allow_substs"}
            if unknown:
                raise CommandError(f"Unexpected attribute(s) found in `param`: {', '.join(sorted(unknown))}")
            if "from" in param:
                file = self._text(param["from"], path)
                if not Path(file).is_file():
                    raise CommandError(f"parameter file '{file}' does not exist")
                sets.append(file)
            else:
                sets.append(self._named_parameters(param, path))
        return sets

    def _named_parameters(self, param: dict[str, Any], path: Path) -> dict[str, Any]:
        name = self._required(param, "name", path)
        if "param" in param:
            nested = [self._named_parameters(inner, path) for inner in param["param"]]
            return {f"{name}.{key}": value for values in nested for key, value in values.items()}
        if "value" not in param:
            raise CommandError(f"parameter '{name}' has no value")
        value = param["value"]
        if isinstance(value, list):
            return {name: [self._typed(item, path) for item in value]}
        return {name: self._typed(value, path, as_text=param.get("type") == "str")}

    def _typed(self, value: Any, path: Path, as_text: bool = False) -> Any:
        """Texts are read as YAML once substitutions are done, so that "$(var seed)" becomes a number."""
        if not isinstance(value, str):
            return value
        text = self._text(value, path)
        if as_text:
            return text
        try:
            typed = yaml.safe_load(text)
        except yaml.YAMLError:
            return text
        return typed if isinstance(typed, (bool, int, float, list)) else text

    def _add_process(
        self,
        attributes: dict[str, Any],
        path: Path,
        command: list[str],
        label: str,
        parameters: tuple[dict[str, Any] | str, ...] = (),
    ) -> None:
        if self._declarations_only:
            return
        output = self._text(attributes.get("output", "log"), path)
        if output not in OUTPUTS:
            raise CommandError(f"output '{output}' is not one of {', '.join(OUTPUTS)}")
        environment = dict(self._environment)
        for variable in attributes.get("env", []):
            environment[self._required(variable, "name", path)] = self._required(variable, "value", path)
        on_exit = self._text(attributes.get("on_exit", ""), path)
        if on_exit not in ("", "shutdown"):
            raise CommandError(f"on_exit '{on_exit}' is not 'shutdown'")
        prefix = shlex.split(self._text(attributes.get("launch-prefix", ""), path))
        self.processes.append(
            ProcessPlan(
                label=label,
                command=tuple(prefix + command),
                output=output,
                environment=environment,
                parameters=parameters,
                cwd=self._text(attributes["cwd"], path) if "cwd" in attributes else None,
                respawn=as_bool(self._text(attributes.get("respawn", "false"), path)),
                respawn_delay=float(self._text(attributes.get("respawn_delay", 0.0), path)),
                shutdown_on_exit=on_exit == "shutdown",
                sigterm_timeout=float(self._text(attributes.get("sigterm_timeout", 5.0), path)),
                sigkill_timeout=float(self._text(attributes.get("sigkill_timeout", 5.0), path)),
            )
        )


def _joined(base: str, namespace: str) -> str:
    if not namespace or namespace.startswith("/"):
        return namespace or base
    return f"{base.rstrip('/')}/{namespace}"
