"""Definitions that no function runs.

settings.json holds everything that can be set. After a wanted change of a default write it anew:

    python src/panda_executor/test/test_values.py
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from panda_executor.config import ExecutorConfig

TABLE = Path(__file__).with_name("settings.json")


def settings() -> Any:
    """Return every setting of the executor's core, by name."""
    return json.loads(json.dumps(asdict(ExecutorConfig()), default=str))


def test_the_defaults_are_those_that_were_measured() -> None:
    assert settings() == json.loads(TABLE.read_text())


def test_dataclasses_are_values() -> None:
    from value_types import complaints  # tests/ is on the path of tests only

    assert complaints("panda_executor", mutable=set()) == []


if __name__ == "__main__":
    TABLE.write_text(json.dumps(settings(), indent=1) + "\n")
