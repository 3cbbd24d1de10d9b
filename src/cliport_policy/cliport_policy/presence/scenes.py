"""Questions about demonstrated scenes: which kinds and colours are there, where, and which are not."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cliport_policy.data.augmentation import PlanarTransform, draw_transform, jitter_height, warp
from cliport_policy.data.color_names import lab
from cliport_policy.data.encoded_rows import Place
from cliport_policy.data.listed_things import ListedThing
from cliport_policy.data.mixture import Mixture
from cliport_policy.networks.joint.color_words import LAB_SCALE
from cliport_policy.observation import stack_channels
from cliport_policy.presence.color_evidence import TERMS
from cliport_policy.presence.kinds import listed_kind
from cliport_policy.presence.scene_net import STRIDE
from cliport_policy.presence.vocabulary import Vocabulary, shade_of

QUESTIONS = 8  # about each scene
_POSITIVE = 3  # of them about what is there
_ANY_COLOR = 0.4  # share of questions about what is there that name no colour
_SHADES = 0.35  # share of scenes in which colours are given as such and not by name, and all is seen in grey
_GRAY = 0.1  # share of the other scenes that are seen in grey
_FORGOTTEN = 0.5  # share of the named colours of which the number is kept back
_FAR = 0.7  # scaled CIELAB: a colour is not one that is farther away than this
_SHADE_ERROR = 0.06  # scaled CIELAB
_TURN_DEG, _LITTLE_TURN_DEG, _SHIFT_PX = 40.0, 8.0, 10.0
_MARGIN = 3  # pixels from the border within which a thing is not asked for
_LIGHT, _CAST, _OFFSET = 0.1, 0.04, 6.0  # spreads of exposure, white balance and black level
_TRIES = 200
_MARKS = 50  # things of a scene, at most, of which the kind is told


class SceneBatch(NamedTuple):
    """Scenes and questions about them. B scenes, Q questions each, N marked things.

    images: (B, 5, H, W). kinds: (B, Q). colors: (B, Q), numbers of named colours, 0 for others and where none is asked.
    terms: (B, Q), numbers of basic terms, -1 where the colour is a shade or none. shades: (B, Q, 3), scaled CIELAB, NaN
    where the colour is a term or none. present, asked: (B, Q) bool; what is not asked counts for nothing. cells:
    (B, Q, 2), row and column where a present one lies. gray: (B,) bool, scenes that are seen without colours. marks:
    (N, 4), scene, kind, row, column of what lies anywhere.
    """

    images: Tensor
    kinds: Tensor
    colors: Tensor
    terms: Tensor
    shades: Tensor
    present: Tensor
    asked: Tensor
    cells: Tensor
    gray: Tensor
    marks: Tensor


class _Seen(NamedTuple):
    """Thing of a scene. cell: (row, col) where it lies in the picture, None if it has left it."""

    kind: int
    color: str
    shade: NDArray[np.float32]  # scaled CIELAB
    cell: tuple[int, int] | None


class _Question(NamedTuple):
    """Question about a scene, and its answer. color: name, "" for any. shade: scaled CIELAB instead of a name."""

    kind: int
    color: str = ""
    shade: NDArray[np.float32] | None = None
    cell: tuple[int, int] | None = None  # where it lies; None if it is not there


class SceneBatches:
    """Batches of a mixture's scenes by their number: the same whenever and in whichever process one is made."""

    def __init__(
        self,
        mixture: Mixture,
        things: Sequence[Mapping[Place, tuple[ListedThing, ...]]],
        vocabulary: Vocabulary,
        batch: int,
        seed: int,
    ) -> None:
        """Prepare batches; things: what lies on the table in each of the mixture's data sets."""
        self._mixture, self._vocabulary, self._batch, self._seed = mixture, vocabulary, batch, seed
        self._things = {str(s.data.folder): each for s, each in zip(mixture.sources, things, strict=True)}
        self._kinds_beside = {folder: sorted(set(self._kinds(each))) for folder, each in self._things.items()}

    def batch(self, number: int) -> SceneBatch:
        """Return a batch. Raises DataError where a scene can't be read."""
        chosen = self._mixture.draw(self._batch, np.random.default_rng((self._seed, number)))
        return _stacked([self._scene(int(i), (self._seed, number, p)) for p, i in enumerate(chosen)], self._vocabulary)

    def _kinds(self, things: Mapping[Place, tuple[ListedThing, ...]]) -> Iterator[int]:
        for each in things.values():
            names = {thing.name for thing in each}
            yield from (self._vocabulary.kind(listed_kind(name, names)) for name in names)

    def _scene(self, index: int, seed: tuple[int, ...]) -> _Scene:
        rng = np.random.default_rng(seed)
        drawn = self._mixture[index]
        folder = str(drawn.data.folder)
        observation = drawn.data.observation(drawn.frame)
        motion = _drawn_motion(observation.valid.shape, rng)
        color, height = _relit(observation.color, rng), jitter_height(observation.height, rng)
        image = warp(stack_channels(color, height, observation.valid), motion)
        things = self._things[folder][drawn.frame.place]
        names = {thing.name for thing in things}
        seen = [self._seen(thing, names, motion, observation.valid.shape) for thing in things]
        by_shade = bool(rng.random() < _SHADES)
        kinds = self._kinds_beside[folder]
        questions = list(_questions(seen, kinds, len(self._vocabulary.kinds), by_shade, rng))
        gray, luck = by_shade or bool(rng.random() < _GRAY), rng.random(QUESTIONS)
        marked = [seen[i] for i in rng.permutation(len(seen))[:_MARKS]]
        return _Scene(image, marked, questions, gray, luck)

    def _seen(self, thing: ListedThing, names: set[str], motion: PlanarTransform, shape: tuple[int, int]) -> _Seen:
        row, col = motion.pixel(thing.pixel)
        inside = all(_MARGIN <= at < size - _MARGIN for at, size in zip((row, col), shape, strict=True))
        kind = self._vocabulary.kind(listed_kind(thing.name, names))
        cell = (int(row) // STRIDE, int(col) // STRIDE) if inside else None
        return _Seen(kind, thing.color if thing.color in TERMS else "", shade_of(thing.rgb), cell)


class _Scene(NamedTuple):
    image: NDArray[np.float32]
    marked: list[_Seen]
    questions: list[_Question]
    gray: bool
    luck: NDArray[np.float64]  # of each question, whether its colour's number is kept back


def _drawn_motion(shape: tuple[int, int], rng: np.random.Generator) -> PlanarTransform:
    """Draw a motion about the picture's middle, by half a turn and more in half of the scenes."""
    sigma = _TURN_DEG if rng.random() < 0.5 else _LITTLE_TURN_DEG
    motion = draw_transform(shape, [], sigma, _SHIFT_PX, rng)
    if rng.random() < 0.5:
        return motion
    rows, cols = shape
    matrix = -motion.matrix
    matrix[:, 2] += (cols - 1, rows - 1)
    return PlanarTransform(motion.angle + math.pi, matrix)


def _relit(color: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Change exposure, white balance and black level by more than a training of policies does."""
    gain = rng.normal(1.0, _LIGHT) * rng.normal(1.0, _CAST, 3)
    out: NDArray[np.uint8] = np.clip(color * gain + rng.normal(0.0, _OFFSET), 0, 255).astype(np.uint8)
    return out


def _questions(
    seen: Sequence[_Seen], kinds: Sequence[int], n_kinds: int, by_shade: bool, rng: np.random.Generator
) -> Iterator[_Question]:
    """Draw questions about what is there, then about what is not: as many as can be found, QUESTIONS at most."""
    shown = [thing for thing in seen if thing.cell is not None]
    which = sorted({(thing.kind, thing.color) for thing in shown})
    asked = 0
    while which and asked < _POSITIVE:
        kind, color = which[int(rng.integers(len(which)))]
        of_kind = [thing for thing in shown if thing.kind == kind]
        any_color = not color or rng.random() < _ANY_COLOR
        same = of_kind if any_color else [thing for thing in of_kind if thing.color == color]
        thing = same[int(rng.integers(len(same)))]
        shade = None if any_color or not by_shade else _about(thing.shade, rng)
        yield _Question(kind, "" if any_color or by_shade else color, shade, thing.cell)
        asked += 1
    for _ in range(_TRIES):
        if asked == QUESTIONS:
            return
        question = _question_in_vain(seen, kinds, n_kinds, by_shade, rng)
        if question is not None:
            yield question
            asked += 1


def _question_in_vain(
    seen: Sequence[_Seen], kinds: Sequence[int], n_kinds: int, by_shade: bool, rng: np.random.Generator
) -> _Question | None:
    """Draw a question about what is not there; None if it is there.

    A third names a kind that is there in another colour, a third a kind of the scene's own task, the others any.
    """
    colored = [thing for thing in seen if thing.color]
    luck = rng.random()
    if luck < 1 / 3:
        if not colored:
            return None
        kind = colored[int(rng.integers(len(colored)))].kind
        return _in_another_color(kind, colored, by_shade, rng)
    kind = kinds[int(rng.integers(len(kinds)))] if luck < 2 / 3 else int(rng.integers(n_kinds))
    if any(thing.kind == kind for thing in seen):
        return None
    if not colored or rng.random() < 0.5:
        return _Question(kind)
    like = colored[int(rng.integers(len(colored)))]
    return _Question(kind, shade=_about(like.shade, rng)) if by_shade else _Question(kind, like.color)


def _in_another_color(
    kind: int, colored: Sequence[_Seen], by_shade: bool, rng: np.random.Generator
) -> _Question | None:
    """Draw a colour that no thing of a kind has, half of the time one of another thing's; None if one has it."""
    own = [thing for thing in colored if thing.kind == kind]
    others = [thing for thing in colored if thing.kind != kind]
    like = others[int(rng.integers(len(others)))] if others and rng.random() < 0.5 else None
    if not by_shade:
        color = like.color if like else TERMS[int(rng.integers(len(TERMS)))]
        return None if any(thing.color == color for thing in own) else _Question(kind, color)
    shade = _about(like.shade, rng) if like else lab(rng.integers(0, 256, (1, 3)).astype(np.float32))[0] / LAB_SCALE
    if min(float(np.linalg.norm(shade - thing.shade)) for thing in own) < _FAR:
        return None
    return _Question(kind, shade=np.asarray(shade, np.float32))


def _about(shade: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    return np.asarray(shade + rng.normal(0.0, _SHADE_ERROR, 3), np.float32)


def _stacked(scenes: Sequence[_Scene], vocabulary: Vocabulary) -> SceneBatch:
    size = (len(scenes), QUESTIONS)
    kinds, colors, terms = np.zeros(size, np.int64), np.zeros(size, np.int64), np.full(size, -1, np.int64)
    shades = np.full((*size, 3), np.nan, np.float32)
    present, asked, cells = np.zeros(size, np.bool_), np.zeros(size, np.bool_), np.zeros((*size, 2), np.int64)
    marks = []
    for number, scene in enumerate(scenes):
        marks += [(number, thing.kind, *thing.cell) for thing in scene.marked if thing.cell is not None]
        for at, question in enumerate(scene.questions):
            kinds[number, at], asked[number, at] = question.kind, True
            if question.color:
                terms[number, at] = TERMS.index(question.color)
                colors[number, at] = vocabulary.color(question.color) if scene.luck[at] >= _FORGOTTEN else 0
            if question.shade is not None:
                shades[number, at] = question.shade
            if question.cell is not None:
                present[number, at], cells[number, at] = True, question.cell
    images = torch.from_numpy(np.stack([scene.image for scene in scenes])).permute(0, 3, 1, 2)
    gray = torch.tensor([scene.gray for scene in scenes])
    return SceneBatch(
        images=images,
        kinds=torch.from_numpy(kinds),
        colors=torch.from_numpy(colors),
        terms=torch.from_numpy(terms),
        shades=torch.from_numpy(shades),
        present=torch.from_numpy(present),
        asked=torch.from_numpy(asked),
        cells=torch.from_numpy(cells),
        gray=gray,
        marks=torch.tensor(marks).reshape(-1, 4),
    )
