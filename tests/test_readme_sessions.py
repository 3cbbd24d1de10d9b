"""README's commands one after the other, as a reader types them, with fewer scenes and steps; real processes.

`make soak PYTEST_ARGS=tests/test_readme_sessions.py` runs this. test_readme.py sees to it that no command is left out.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from readme_commands import README, smaller, snippet
from ros2_process import ROS2, Background, ros2
from ros_domain import next_domain

pytestmark = [pytest.mark.soak, pytest.mark.timeout(3600)]
BOWLS = "put-blocks-in-bowls-seen-colors"
GRAPH = {  # command: what it says
    "ros2 launch cliport_bringup sim.launch.yaml seed:=7": r"process started",
    "ros2 topic echo /cliport/status": r"^state: ",
    "ros2 topic pub --once /cliport/instruction std_msgs/msg/String "
    "\"{data: 'put the red blocks in a blue bowl'}\"": "publishing #1",
    'ros2 service call /cliport/approve cliport_interfaces/srv/ApprovePlan "{plan_id: 1a2b3c4d}"': "success=False",
    "ros2 service call /cliport/stop std_srvs/srv/Trigger": "success=True",
}
FEW = {"--episodes": "4"}
QUICK = "--steps 4 --batch 2"
GENERATE = (
    f"ros2 run cliport_benchmark generate --task {BOWLS} --split train --first-seed 0 --episodes 6000 "
    "--goals-per-scene 5 --randomize --processes 2 --out data/train"
)
LESSONS: dict[str, dict[str, str]] = {  # command: what is smaller than in README
    GENERATE: FEW,
    "ros2 run cliport_policy train --data data/train --out runs/bowls": {"--steps": "4", "--batch": "2"},
    f"ros2 run cliport_benchmark evaluate --checkpoint runs/bowls --task {BOWLS} --split test "
    "--first-seed 0 --episodes 100 --processes 2 --out out/seen.json": {"--episodes": "2"},
    f"ros2 run cliport_benchmark experiment --task {BOWLS} --config compact,transporter_rotator "
    "--n-demos 1,10,100,1000 --out out/exp": {
        "--config": "compact", "--n-demos": "1,2", "--steps": "2", "--val-episodes": "1", "--test-episodes": "1",
        "--train-options": "--batch 1",
    },
    "ros2 run cliport_policy explain --data data/val --row 3 --out out/explain.png": {},
    "ros2 run cliport_policy calibrate --checkpoint runs/bowls --data data/val": {"--count": "4"},
    "ros2 run cliport_policy reliability --checkpoint runs/bowls --data data/test": {"--count": "2"},
    "ros2 run cliport_policy learn --from-bags demonstrations/mine --out runs/mine": {"--train-options": QUICK},
    "ros2 run cliport_benchmark evaluate --checkpoint expert --task all --split test --first-seed 0 --episodes 50 "
    "--out out/expert": {"--task": f"block-insertion,{BOWLS}", "--episodes": "1"},
    "ros2 run cliport_benchmark evaluate --checkpoint default --task all --split test --first-seed 1100 --episodes 100 "
    "--out out/default": {
        "--task": BOWLS, "--first-seed": "0", "--episodes": "1", "--out": "out/default.json",
    },
    "ros2 run cliport_benchmark evaluate --checkpoint blind --without-arm --task all --split test --episodes 50 "
    "--out out/blind": {"--task": f"block-insertion,{BOWLS}", "--episodes": "1"},
    "ros2 run cliport_benchmark results out/expert out/blind --out out/results.md": {},
    "ros2 run cliport_benchmark results out/expert --by-split": {},
    "ros2 run cliport_benchmark worst out/blind --out out/worst": {},
    "ros2 run cliport_benchmark card_scores --checkpoint runs/bowls out/seen.json": {},
    "ros2 run cliport_benchmark understanding --checkpoint runs/bowls --task all": {"--task": BOWLS, "--episodes": "1"},
    "ros2 run cliport_benchmark gallery --out out/benchmark.png --videos out/videos": {"--tasks": "block-insertion"},
    "ros2 run cliport_benchmark generate --task towers-of-hanoi-seq-seen-colors --split train --episodes 1000 "
    "--out data/hanoi": {"--episodes": "1"},
}  # fmt: skip
WRITTEN = (
    "data/train/part-00000.parquet", "runs/bowls/policy.safetensors", "out/seen.json", "out/default.json",
    "out/explain.png", "runs/mine", "out/results.md", "out/benchmark.png", "out/videos/block-insertion.mp4",
    "data/hanoi/part-00000.parquet",
)  # fmt: skip


def typed(words: list[str], folder: Path) -> str:
    """Run a command in a folder; return what it printed."""
    assert words[0] == "ros2"
    done = subprocess.run([ROS2, *words[1:]], cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, f"{shlex.join(words)}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    return done.stdout


def test_data_training_and_scores_follow_one_another(tmp_path: Path) -> None:
    for split in ("val", "test"):
        typed(smaller(GENERATE, {**FEW, "--split": split, "--out": f"data/{split}"}), tmp_path)
    record = f"ros2 run cliport_benchmark record --task {BOWLS} --episodes 3 --out demonstrations/mine"
    typed(shlex.split(record), tmp_path)
    for command, changes in LESSONS.items():
        typed(smaller(command, changes), tmp_path)
    missing = [name for name in WRITTEN if not (tmp_path / name).exists()]
    assert not missing
    done = subprocess.run(
        [sys.executable, "-c", "import PIL.Image; PIL.Image.Image.show = print\n" + snippet(README, "pyarrow")],
        cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert re.search(r"^put .* \d+ \d+$", done.stdout, re.MULTILINE), done.stderr


def test_the_graph_hears_what_readme_types(tmp_path: Path) -> None:
    environment = {**os.environ, "ROS_DOMAIN_ID": str(next_domain()), "PYTHONUNBUFFERED": "1"}
    launch, echo, *calls = ((shlex.split(command)[1:], said) for command, said in GRAPH.items())
    graph = Background(environment, ROS2, *launch[0])
    try:
        graph.read_until(launch[1])
        status = Background(environment, ROS2, *echo[0])
        try:
            status.read_until(echo[1])  # latched: the policy server is there
            for arguments, said in calls:
                answer = ros2(environment, *arguments)
                assert answer.returncode == 0 and said in answer.stdout, answer.stdout + answer.stderr
            status.read_until("stop")
        finally:
            status.end()
    finally:
        assert graph.end() in (0, 2, 130)
