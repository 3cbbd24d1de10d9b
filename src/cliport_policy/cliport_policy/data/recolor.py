"""Demonstrations in other colours: a thing that a sentence calls red is painted blue, and the sentence says blue.

So ten demonstrations teach each of their colours both for the pick and for the place. A thing that had the new colour
before gets the old one: the sentence still names one thing of the scene.
"""

from __future__ import annotations

from itertools import permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cliport_core.heightmap import Heightmap
from cliport_policy.data.color_names import distance, lab, rename, rgb, surveyed_shades, terms_in
from cliport_policy.data.demonstrations import Demonstration
from cliport_policy.data.mixture import Drawn, Mixture
from cliport_policy.data.things import raised

Lab = NDArray[np.float32]  # CIELAB: (3,), or (N, 3) shades
_Key = tuple[str, str, int, str]  # folder, task, episode, sentence

_PATCH_RADIUS = 3  # pixels around a pick or a place that show its colour
_MAX_DISTANCE = 14.0  # CIELAB units between one thing's pixels and its colour
_MAX_SHADE_DISTANCE = 30.0  # CIELAB units from a term's nearest shade; beyond them nobody uses the term
_MAX_TERMS = 2  # colour terms of a sentence: the pick's and the place's
_MAX_SCENES = 200  # number of scenes to learn colours from
_MAX_SHADES = 24  # number of shades that represent a colour
_SURVEYED_WEIGHT = 0.2  # weight of a colour that only the survey knows; people will ask for the demonstrated ones
_MAX_SENTENCES = 4000  # number of repainted sentences, whose embeddings must fit in memory


class Paint(NamedTuple):
    """Shades (N, 3) that become the colour new (3,)."""

    shades: Lab
    new: Lab


class Repainting(NamedTuple):
    """Exchange of colours, in the scene and in the sentence."""

    terms: dict[str, str]
    paints: tuple[Paint, ...]

    def sentence(self, sentence: str) -> str:
        """Return a sentence with its colour terms replaced."""
        return rename(sentence, self.terms)

    def image(self, scene: Heightmap) -> NDArray[np.uint8]:
        """Return the scene in its new colours, shaded as it was: (H, W, 3) RGB."""
        out = scene.color.copy()
        things = raised(scene)
        pixels = lab(out[things])
        if not len(pixels):
            return out
        apart = np.stack([distance(pixels, paint.shades) for paint in self.paints])  # (paints, N)
        nearest = np.where(apart.min(0) < _MAX_DISTANCE, apart.argmin(0), -1)
        for number, paint in enumerate(self.paints):
            chosen = nearest == number
            if chosen.any():
                pixels[chosen] = _repaint(pixels[chosen], paint.new)
        changed = np.flatnonzero(things.ravel())[nearest >= 0]
        out.reshape(-1, 3)[changed] = rgb(pixels[nearest >= 0])
        return out


class Recoloring:
    """Colours that a mixture's demonstrations show and name, and repaintings among them."""

    def __init__(self, mixture: Mixture, surveyed: bool, rng: np.random.Generator) -> None:
        """Learn the colours of the mixture's demonstrations.

        surveyed: True adds the basic colours that no demonstration names, in the survey's shades.

        Raises:
            DataError: if an observation can't be read.
        """
        self._first_actions: dict[_Key, Drawn] = {}
        for i in range(len(mixture)):
            drawn = mixture[i]
            if drawn.demo.acts and drawn.settings.recolor:
                self._first_actions.setdefault(_key(drawn), drawn)
        self._named: dict[_Key, dict[str, Lab]] = {}
        self._palette = self._learn_palette(rng)
        demonstrated = set(self._palette)
        if surveyed:
            self._palette = {term: _spread(shades) for term, shades in surveyed_shades().items()} | self._palette
        self._changes = self._draw_changes(sorted({sentence for *_, sentence in self._first_actions}), rng)
        self._weights: dict[str, NDArray[np.float64]] = {}
        for text, changes in self._changes.items():
            n_surveyed = [len(set(change.values()) - demonstrated) for change in changes]
            self._weights[text] = np.cumsum([_SURVEYED_WEIGHT**n for n in n_surveyed])

    def sentences_of(self, instruction: str) -> set[str]:
        """Return what repaintings may make of a sentence; nothing of one that is never repainted."""
        return {rename(instruction, terms) for terms in self._changes.get(instruction, ())}

    def draw(self, drawn: Drawn, rng: np.random.Generator) -> Repainting | None:
        """Draw a repainting; None if the sentence names no colour that was recognised in its episode."""
        changes, named = self._changes.get(drawn.demo.instruction), self._colors_of(_key(drawn))
        if not changes or not named:
            return None
        weights = self._weights[drawn.demo.instruction]
        terms = changes[int(np.searchsorted(weights, rng.random() * weights[-1], side="right"))]
        paints = [Paint(named[term][None], self._shade(new, rng)) for term, new in terms.items()]
        taken = sorted(set(terms.values()) - set(terms))
        free = rng.permutation(sorted(set(terms) - set(terms.values())))
        paints += [Paint(self._palette[term], named[old]) for term, old in zip(taken, free, strict=True)]
        return Repainting(terms, tuple(paints))

    def _shade(self, term: str, rng: np.random.Generator) -> Lab:
        shades = self._palette[term]
        return shades[int(rng.integers(len(shades)))]

    def _learn_palette(self, rng: np.random.Generator) -> dict[str, Lab]:
        found: dict[str, list[Lab]] = {}
        keys = list(self._first_actions)
        for i in rng.permutation(len(keys))[:_MAX_SCENES]:
            for term, color in self._colors_of(keys[i]).items():
                found.setdefault(term, []).append(color)
        return {term: _spread(np.array(found[term])) for term in sorted(found)}

    def _draw_changes(self, instructions: list[str], rng: np.random.Generator) -> dict[str, list[dict[str, str]]]:
        most = max(6, _MAX_SENTENCES // max(len(instructions), 1))
        return {text: self._changes_for(text, most, rng) for text in instructions}

    def _changes_for(self, text: str, most: int, rng: np.random.Generator) -> list[dict[str, str]]:
        terms = terms_in(text)
        if not 1 <= len(terms) <= _MAX_TERMS or not set(terms) <= set(self._palette):
            return []
        others = [new for new in permutations(self._palette, len(terms)) if list(new) != terms]
        kept = sorted(rng.permutation(len(others))[:most])
        return [dict(zip(terms, others[i], strict=True)) for i in kept]

    def _colors_of(self, key: _Key) -> dict[str, Lab]:
        if key not in self._named:
            drawn = self._first_actions.get(key)
            self._named[key] = {} if drawn is None else named_colors(drawn.demo, drawn.data.observation(drawn.frame))
        return self._named[key]


def named_colors(demo: Demonstration, scene: Heightmap) -> dict[str, Lab]:
    """Return the colour (3,) of each colour term in a demonstration's sentence, seen at its pick or at its place.

    The mapping is empty if not all are recognised.
    """
    terms = terms_in(demo.instruction)
    if not 1 <= len(terms) <= _MAX_TERMS:
        return {}
    seen = np.stack([_color_at(scene, pixel) for pixel in (demo.pick_pixel, demo.place_pixel)])
    apart = np.stack([distance(seen, surveyed_shades()[term]) for term in terms])  # (terms, 2)
    orders = list(permutations(range(2), len(terms)))
    best = min(orders, key=lambda order: sum(apart[i, at] for i, at in enumerate(order)))
    if any(apart[i, at] > _MAX_SHADE_DISTANCE for i, at in enumerate(best)):
        return {}
    return {term: seen[at] for term, at in zip(terms, best, strict=True)}


def _key(drawn: Drawn) -> _Key:
    return str(drawn.data.folder), drawn.frame.task, drawn.frame.episode, drawn.demo.instruction


def _color_at(scene: Heightmap, pixel: tuple[int, int]) -> Lab:
    row, col = pixel
    rows = slice(max(row - _PATCH_RADIUS, 0), row + _PATCH_RADIUS + 1)
    cols = slice(max(col - _PATCH_RADIUS, 0), col + _PATCH_RADIUS + 1)
    patch = scene.color[rows, cols]
    out: Lab = np.median(lab(patch.reshape(-1, 3)), axis=0).astype(np.float32)
    return out


def _repaint(pixels: Lab, new: Lab) -> Lab:
    """Replace one colour of pixels (N, 3) by another, keeping their relative lightness and their difference in hue."""
    old = np.median(pixels, axis=0)
    lightness = pixels[:, :1] / max(float(old[0]), 1.0)
    hue = pixels[:, 1:] + lightness * (new[1:] - old[1:])
    return np.concatenate((lightness * new[0], hue), axis=1)


def _spread(shades: Lab) -> Lab:
    """Return at most _MAX_SHADES of the shades (N, 3), far from each other."""
    chosen = [0]
    apart = distance(shades, shades[:1])
    while len(chosen) < min(_MAX_SHADES, len(shades)):
        chosen.append(int(apart.argmax()))
        apart = np.minimum(apart, distance(shades, shades[chosen[-1:]]))
    return shades[chosen]
