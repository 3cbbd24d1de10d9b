"""Shares of the wordings that a training remembers: a data set of many sentences eats no other's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from cliport_policy.config import TrainConfig
from cliport_policy.data.mirror import mirrored_sentences
from cliport_policy.data.mixture import Mixture
from cliport_policy.data.recolor import Recoloring


class SentenceGroup(NamedTuple):
    """Sentences of one data set, and how many wordings each shall have beside itself."""

    sentences: set[str]
    wanted: int


def sentence_groups(mixture: Mixture, recoloring: Recoloring | None, config: TrainConfig) -> list[SentenceGroup]:
    """Return each data set's sentences, and what repainting and mirrors make of them, and the wordings it wants."""
    groups = []
    for source, own in zip(mixture.sources, mixture.instructions_by_source(), strict=True):
        sentences = set(own)
        if recoloring is not None and source.settings.recolor:
            sentences.update(*map(recoloring.sentences_of, own))
        if config.mirror_probability:
            sentences.update(*[mirrored_sentences(sentence) for sentence in sentences])
        groups.append(SentenceGroup(sentences, config.phrases_per_goal if source.settings.paraphrase else 0))
    return groups


def share_wordings(groups: Sequence[SentenceGroup], most: int) -> dict[str, int]:
    """Return how many wordings to draw of each sentence; with the sentences themselves at most `most`, if these fit.

    What is left beside the sentences themselves is dealt out to the groups alike, in a group to its sentences alike;
    what a group does not want goes to the others. A sentence of two groups has the larger number.
    """
    found = {sentence: 0 for group in groups for sentence in group.sentences}
    left = max(most - len(found), 0)
    takers = sorted(
        (group for group in groups if group.sentences), key=lambda group: group.wanted * len(group.sentences)
    )
    for number, group in enumerate(takers):
        share = left // (len(takers) - number)
        each = min(group.wanted, share // len(group.sentences))
        left -= each * len(group.sentences)
        for sentence in group.sentences:
            found[sentence] = max(found[sentence], each)
    return found
