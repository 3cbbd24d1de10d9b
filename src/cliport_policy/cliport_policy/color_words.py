"""`ros2 run cliport_policy fit_color_words`: teach the colour head the survey's names.

The names and their colours are those of the xkcd survey (2010), as Matplotlib ships them. Each is put into sentences,
so that the head learns to tell colour words from others, and which words belong to one name.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import save_file
from torch import Tensor
from torch.nn import functional as F

from cliport_core.command_line import CommandParser
from cliport_policy.checkpoint import StoredTensors, halved
from cliport_policy.data.color_names import names_told
from cliport_policy.errors import CheckpointError, ConfigError, PolicyError
from cliport_policy.language import TextEncoder, shared_encoder
from cliport_policy.networks.joint.color_words import ColorHead, scaled_lab
from cliport_policy.settings import check_choice
from cliport_policy.whole_files import whole_file

ARMS = ("strict", "open")
FOLDER = Path(__file__).parent / "color_heads"
_TEMPLATES = (
    "put the {} blocks in a {} bowl",
    "pack all the {} and {} blocks into the box",
    "put the {} star in the top star hole",
    "put the {} block on the {} and {} blocks",
    "push the pile of {} blocks into the {} square",
    "move the {} ring to the middle of the stand",
    "the {} thing goes to the {} one",
    "take everything {} and drop it near something {}",
    "align the rope from front left tip to back right corner",
    "pack the toy train in the box, please",
    "{}",
)
_LIGHT_SIGMA, _HUE_SIGMA = 0.12, 0.04  # errors of a name's colour, scaled CIELAB: light and shadow, white balance
_SHADE_SHARE = 0.5  # how often a one-word name gets a shade of its own ("dusty purple") as its colour


class Survey(NamedTuple):
    """Colour names (N) and their scaled CIELAB colours (N, 3); shades: numbers of the names that end with each name."""

    names: list[str]
    colors: Tensor
    shades: list[list[int]]


def read_survey(arm: str) -> Survey:
    """Return the survey's names; `strict` leaves out those that hold a word of the unseen colours."""
    check_choice(arm, ARMS, "arm")
    told = names_told(arm)
    shades = [[j for j, other in enumerate(told) if other.split()[-1] == name] for name in told]
    return Survey(list(told), scaled_lab(torch.tensor(list(told.values()))), shades)


def load_color_head(arm: str) -> ColorHead:
    """Return the shipped head of an arm, which learns nothing more.

    Raises:
        CheckpointError: if its file can't be read.
    """
    check_choice(arm, ARMS, "arm")
    path = FOLDER / f"{arm}.safetensors"
    head = ColorHead()
    try:
        head.load_state_dict(dict(StoredTensors(path)))
    except (OSError, RuntimeError, SafetensorError) as error:
        raise CheckpointError(f"can't read {path} ({error}): run fit_color_words again") from error
    return head.requires_grad_(False).eval()


class _Example(NamedTuple):
    """One sentence's tokens (T, D) and, for each, the number of the name that it belongs to, or -1 (T,)."""

    tokens: Tensor
    name: Tensor


def fit(arm: str, steps: int, seed: int, encoder: TextEncoder) -> tuple[ColorHead, float]:
    """Fit a head to an arm's names; return it and the mean loss of its last hundred steps."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    survey = read_survey(arm)
    examples = _examples(survey, encoder, rng)
    head = ColorHead()
    optimizer = torch.optim.AdamW(head.parameters(), lr=2e-3, weight_decay=0.02)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    last: list[float] = []
    for _ in range(steps):
        chosen = [examples[i] for i in rng.integers(len(examples), size=96)]
        loss = _loss(head, chosen, survey, rng)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        last = [*last[-99:], loss.item()]
    return head.requires_grad_(False).eval(), float(np.mean(last))


def _examples(survey: Survey, encoder: TextEncoder, rng: np.random.Generator) -> list[_Example]:
    """Put each name into sentences, one-word names more often, since people say these most."""
    numbers = list(range(len(survey.names)))
    often = [i for i in numbers if " " not in survey.names[i]]
    basic = [i for i in often if len(survey.shades[i]) > 5]
    found = []
    for first in [*numbers, *numbers, *often, *often, *(basic * 10)]:
        template = _TEMPLATES[int(rng.integers(len(_TEMPLATES)))]
        others = rng.choice(often if rng.random() < 0.5 else numbers, 3).tolist()
        order = [first, *others]
        rng.shuffle(order)
        found.append(_example(template, order[: template.count("{}")], survey, encoder))
    return found


def _example(template: str, chosen: Sequence[int], survey: Survey, encoder: TextEncoder) -> _Example:
    pieces = template.split("{}")
    labels = [-1]  # the sentence's first token
    text = ""
    for number, piece in enumerate(pieces):
        text += piece
        labels += [-1] * encoder.count_tokens(piece)
        if number < len(chosen):
            name = survey.names[chosen[number]]
            text += name
            labels += [chosen[number]] * encoder.count_tokens(name)
    tokens = encoder.encode([text]).tokens[0]
    labels = [*labels, -1][: len(tokens)]
    return _Example(tokens.clone(), torch.tensor(labels))


def _loss(head: ColorHead, chosen: Sequence[_Example], survey: Survey, rng: np.random.Generator) -> Tensor:
    tokens, names = torch.cat([e.tokens for e in chosen]), torch.cat([e.name for e in chosen])
    density = head(tokens)
    named = names >= 0
    is_color = F.binary_cross_entropy_with_logits(density.is_color, named.float())
    targets = torch.stack([_target(survey, int(i), rng) for i in names[named]])
    kept = type(density)(*(value[named] for value in density))
    return is_color - 0.3 * kept.log_likelihood(targets).mean()


def _target(survey: Survey, name: int, rng: np.random.Generator) -> Tensor:
    """Draw a colour that a name may mean, in some light."""
    shades = survey.shades[name]
    if len(shades) > 1 and rng.random() < _SHADE_SHARE:
        name = shades[int(rng.integers(len(shades)))]
    error = rng.normal(0.0, (_LIGHT_SIGMA, _HUE_SIGMA, _HUE_SIGMA))
    return survey.colors[name] + torch.tensor(error, dtype=torch.float32)


def likelihoods(
    head: ColorHead, words: Sequence[str], colors: Tensor, encoder: TextEncoder, template: str = "put the {} block here"
) -> NDArray[np.float64]:
    """Return the log likelihood (W, N) of N sRGB colours (N, 3), 0..1, for each word inside a sentence."""
    rows = []
    for word in words:
        before, _ = template.split("{}")
        first = 1 + encoder.count_tokens(before)
        tokens = encoder.encode([template.format(word)]).tokens[0][first : first + encoder.count_tokens(word)]
        density = head(tokens)
        each = [density.log_likelihood(color.expand(len(tokens), 3)).mean() for color in scaled_lab(colors)]
        rows.append(torch.stack(each).numpy())
    return np.array(rows, np.float64)


def main(argv: Sequence[str] | None = None) -> int:
    """Fit both arms, write their files, print their losses; return the exit status."""
    parser = CommandParser(prog="fit_color_words", description="Teach the colour head the survey's names.")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder for strict.safetensors and open.safetensors")
    parser.add_argument("--steps", type=int, default=1500)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args(argv)
    try:
        if args.steps < 1:
            raise ConfigError(f"--steps must be 1 or more, not {args.steps}")
        for arm in ARMS:
            head, loss = fit(arm, args.steps, args.seed, shared_encoder())
            path = args.out / f"{arm}.safetensors"
            with whole_file(path) as temporary:
                save_file(halved(head.state_dict()), temporary)
            print(f"{arm}: {len(read_survey(arm).names)} names, loss {loss:.3f}, {path}")
    except PolicyError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
