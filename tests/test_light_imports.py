"""Commands that read or write data start without torch, whose import alone takes seconds."""

from __future__ import annotations

import subprocess
import sys

COMMANDS = (
    *("record_cli", "generate_cli", "evaluate_cli", "evaluate_graph", "gallery_cli"),
    *("results", "card_scores", "worst_cli", "experiment_cli", "understanding_cli"),
)
PROGRAM = """
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(f"cliport_benchmark.{name}")
    if "torch" in sys.modules:
        sys.exit(f"{name} imports torch")
import cliport_policy
if not callable(cliport_policy.load_policy) or "torch" not in sys.modules:
    sys.exit("a policy is not there when it is asked for")
if hasattr(cliport_policy, "nothing"):
    sys.exit("what is not there is found")
"""


def test_no_network_is_imported_before_it_is_asked_for() -> None:
    program = [sys.executable, "-c", PROGRAM, *COMMANDS]
    ended = subprocess.run(program, stderr=subprocess.PIPE, text=True, timeout=120, check=False)
    assert ended.returncode == 0, ended.stderr
