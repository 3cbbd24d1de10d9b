"""Scenes under sentences about what is not in them, so that a network learns to say so."""

from __future__ import annotations

import dataclasses

import numpy as np

from cliport_policy.data.demonstrations import Demonstration
from cliport_policy.data.mixture import Drawn, Mixture
from cliport_policy.data.named_things import NamedThings, named_things
from cliport_policy.errors import ConfigError

_OWN_SHARE = 0.75  # of exchanged sentences that are about the scene's own task
_HARD_SHARE = 0.5  # of exchanged sentences that name colours which the scene shows, at other things, if one is found
_TRIES = 12


class Absences:
    """Sentences of a mixture, from which one is drawn that names something which a scene lacks."""

    def __init__(self, mixture: Mixture) -> None:
        """Read what the mixture's sentences name.

        Raises:
            ConfigError: if a data set does not list the things on the table.
        """
        self._own: dict[str, list[tuple[str, NamedThings]]] = {}
        for source in mixture.sources:
            if not any(frame.things for frame in source.data.frames):
                raise ConfigError(
                    f"absent_share is not for {source.data.folder}, which does not list the things on the table: "
                    "generate it again with this version, or leave absent_share 0"
                )
            sentences = {demo.instruction for frame in source.data.frames for demo in frame.demos}
            read = [(sentence, named_things(sentence)) for sentence in sorted(sentences)]
            self._own[str(source.data.folder)] = [(sentence, things) for sentence, things in read if things]
        self._all = [sentences for sentences in self._own.values() if sentences]

    def draw(self, drawn: Drawn, rng: np.random.Generator) -> Drawn:
        """Return a drawn scene under a sentence about what it lacks; itself if none was found.

        The other ones are of any data set alike, however few its sentences are: a rope has four, kits have hundreds.
        Half of the sentences name colours that something else in the scene has: these are hard to tell.
        """
        if not drawn.frame.things or not self._all:
            return drawn
        shown = {color for color, _ in drawn.frame.things}
        is_hard, found = rng.random() < _HARD_SHARE, None
        for _ in range(_TRIES):
            sentences = self._own[str(drawn.data.folder)]
            if not sentences or rng.random() >= _OWN_SHARE:
                sentences = self._all[int(rng.integers(len(self._all)))]
            sentence, things = sentences[int(rng.integers(len(sentences)))]
            if things.are_among(drawn.frame.things):
                continue
            found = sentence
            if not is_hard or things.colors() <= shown:
                break
        return drawn if found is None else drawn._replace(demo=_absent(drawn.demo, found))


def _absent(demo: Demonstration, sentence: str) -> Demonstration:
    nowhere = (-1, -1)
    return dataclasses.replace(
        demo, instruction=sentence, done=False, absent=True, pick_pixel=nowhere, place_pixel=nowhere
    )
