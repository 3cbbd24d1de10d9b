"""Summaries come back from the index as they were made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from cliport_core.outcome import Outcome, Refusal
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.edits import MARKS, verdict_words
from cliport_episodes.summary import EpisodeIndex


def test_the_index_gives_back_what_was_put_in(
    data_set: DataSet, add_episode: Callable[..., str], record: StepRecord
) -> None:
    assert record.result is not None
    refused = replace(record.result, outcome=Outcome.REJECTED, refusal=Refusal.OLD_CLOUD, refusal_value=3.0)
    add_episode(data_set.path, 1)
    (info,) = data_set.episodes()
    index = EpisodeIndex(data_set.path / "index.json")
    index._store({info.name: ("signature", replace(info, records=(replace(record, result=refused),)))})
    (result,) = [each.result for _, known in index._load().values() for each in known.records]
    assert result == refused and result is not None
    assert result.refusal is Refusal.OLD_CLOUD and result.outcome is Outcome.REJECTED


def test_a_mark_has_one_word() -> None:
    assert [verdict_words(mark) for mark in MARKS.values()] == list(MARKS)
