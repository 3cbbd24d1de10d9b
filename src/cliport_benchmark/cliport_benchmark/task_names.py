"""Tasks as a command line names them."""

from __future__ import annotations

from sim_bridge.tasks import ALIASES, DEMO_TASKS, LANGUAGE_SPLITS

GROUPS = {"all": LANGUAGE_SPLITS, "demo": DEMO_TASKS}


def task_names(text: str) -> list[str]:
    """Return full names, each once, of a list with commas between names, aliases and groups: all or demo.

    Unknown names stay as they are: whoever makes the task refuses them.
    """
    asked = [name.strip() for name in text.split(",")]
    return list(dict.fromkeys(full for name in asked for full in GROUPS.get(name, (ALIASES.get(name, name),))))
