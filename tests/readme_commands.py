"""What README tells its reader to type: commands and Python, out of its blocks and its code between backticks."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PROGRAMS = ("git", "make", "pip", "python", "ros2", "source", "tensorboard", "torchrun", "uv")
_BLOCK = re.compile(r"(?:^    .*\n)+", re.MULTILINE)
_COMMENT = re.compile(r"\s{2,}#.*")
_CODE = re.compile(r"`([^`]+)`")


def blocks(text: str) -> list[list[str]]:
    """Return the lines of each indented block; continued lines are joined, and comments behind them left out."""
    found = []
    for block in _BLOCK.findall(text):
        joined = re.sub(r" *\\\n *", " ", block)
        found.append([_COMMENT.sub("", line).strip() for line in joined.splitlines()])
    return found


def is_command(line: str) -> bool:
    """Return True if a line begins with one of the programs that README has its reader start."""
    return line.split()[0] in PROGRAMS and " " in line


def is_python(block: list[str]) -> bool:
    """Return True if a block holds Python."""
    return re.match(r"(import|from) ", block[0]) is not None


def commands(text: str) -> list[str]:
    """Return each command of the blocks and of the code between backticks, once, in the order of their place."""
    typed = [line for block in blocks(text) if not is_python(block) for line in block if is_command(line)]
    prose = " ".join(_BLOCK.sub("\n", text).split())
    named = [code for code in _CODE.findall(prose) if is_command(code)]
    return list(dict.fromkeys([*typed, *named]))


def neither(text: str) -> list[str]:
    """Return the lines of the blocks that are neither commands nor Python."""
    return [line for block in blocks(text) if not is_python(block) for line in block if not is_command(line)]


def snippet(text: str, name: str) -> str:
    """Return the Python of the block in which a name stands."""
    (found,) = ["\n".join(block) for block in blocks(text) if is_python(block) and name in "\n".join(block)]
    return found


def smaller(command: str, changes: dict[str, str]) -> list[str]:
    """Return a command's words with other values for some of its flags; flags that it lacks are added."""
    words = shlex.split(command)
    for flag, value in changes.items():
        if flag in words:
            words[words.index(flag) + 1] = value
        else:
            words += [flag, value]
    return words
