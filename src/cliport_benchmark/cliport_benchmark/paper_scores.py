"""Scores that the paper reports, by table, and which of its rows a network of this project stands beside.

Tables 1 and 5 hold scores on test scenes, tables 4 and 6 on validation scenes; docs/paper.md, "Evaluation", says what
the numbers are.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

DEMO_COUNTS = (1, 10, 100, 1000)
TEST_TABLE, VAL_TABLE, ABLATION_TABLE, DEMO_VAL_TABLE = "1", "4", "5", "6"
_FILES = ("paper_results_test.csv", "paper_results.csv")  # table 1; tables 4 to 6
_WITH_ROTATOR = "_rotator"  # ending of the configs that are a network of the paper for a parallel hand


class PaperRow(NamedTuple):
    """Names that one network has in the paper's tables, "" where a table lacks it."""

    main: str  # in tables 1 and 4
    ablation: str = ""  # in table 5
    demo: str = ""  # in table 6

    @property
    def name(self) -> str:
        """The name that tables show."""
        return self.main or self.ablation or self.demo

    def score(self, table: str, task: str, n_demos: int) -> float | None:
        """Return the score, 0..100, in a table; None where it has none."""
        name = {ABLATION_TABLE: self.ablation, DEMO_VAL_TABLE: self.demo}.get(table, self.main)
        return paper_scores().get((table, name, task, n_demos))


YARDSTICK = PaperRow("CLIPORT (single)", "Two-Stream CLIP-Transporter (ours)", "CLIPORT w/o Lang")
_ROWS = {
    "cliport": YARDSTICK,
    "transporter": PaperRow("Transporter-only", "One-Stream Transporter-only", "Transporter"),
    "clip_only": PaperRow("CLIP-only", "One-Stream CLIP-only"),
    "rn50_bert": PaperRow("RN50-BERT", "Two-Stream RN50-BERT-Transporter"),
    "image_goal": PaperRow("", "One-Stream Image-Goal Transporter"),
    "language_transporter": PaperRow("", "One-Stream Language Transporter"),
    "wo_skips": PaperRow("", "Two-Stream CLIP-Transporter w/o skips"),
    "untrained_sem": PaperRow("", "Two-Stream Untrained-Sem-Transporter"),
    "cliport_wo_lang": PaperRow("", "", "CLIPORT w/o Lang"),
    "compact_wo_lang": PaperRow("Transporter-only", "", "Transporter"),
    "compact_wo_height": PaperRow("CLIP-only"),
}


def paper_row(config: str, own_encoders: bool = True) -> PaperRow:
    """Return the paper's row that a network stands beside, by its config's name or file.

    own_encoders: False for a network whose encoders were replaced: it is none of the paper's and stands beside the
    yardstick, CLIPort itself, as all do that the paper lacks.
    """
    name = Path(config).stem.removesuffix(_WITH_ROTATOR)
    return _ROWS.get(name, YARDSTICK) if own_encoders else YARDSTICK


@lru_cache(maxsize=1)
def paper_scores() -> dict[tuple[str, str, str, int], float]:
    """Return what the paper reports, by table, method, task and number of demonstrations."""
    scores = {}
    for name in _FILES:
        with Path(__file__).with_name(name).open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                scores[row["table"], row["method"], row["task"], int(row["n_demos"])] = float(row["score"])
    return scores


def paper_methods(table: str) -> list[str]:
    """Return the names of a table's methods in its order."""
    return list(dict.fromkeys(method for t, method, _, _ in paper_scores() if t == table))


def paper_columns(table: str, demos: Sequence[int]) -> list[tuple[str, int]]:
    """Return the methods of a table, "" for none, with each of some numbers of demonstrations, by these numbers."""
    return [(method, count) for count in demos for method in paper_methods(table)]
