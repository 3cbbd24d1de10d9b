"""The training grammar with its dice loaded: each choice, to either side of its share."""

import numpy as np
import pytest

from cliport_policy.data.paraphrase import paraphrase

CANONICAL = "put the green blocks in a yellow bowl"


class Dice:
    """Falls as it is told; afterwards nothing may be left over."""

    def __init__(self, shares: list[float], choices: list[int]) -> None:
        self.shares, self.choices = list(shares), list(choices)

    def random(self) -> float:
        return self.shares.pop(0)

    def integers(self, n: int) -> int:
        assert 0 <= self.choices[0] < n
        return self.choices.pop(0)


# unchanged, plural, form of the block, plural of the bowl, its form, imperative, greeted, ending, capital, full stop
SHARES = [0.1, 0.49, 0.0, 0.15, 0.0, 0.59, 0.35, 0.3, 0.25, 0.2]
CHOICES = [0] * 7  # noun and quantifier of the block, those of the bowl, frame, verb, preposition


@pytest.mark.parametrize(
    ("at", "share", "said"),
    [
        (0, 0.1, "put the green blocks in the yellow bowl"),
        (0, 0.099, CANONICAL),
        (1, 0.5, "put the green block in the yellow bowl"),
        (2, 0.699, "put the green blocks in the yellow bowl"),
        (2, 0.7, "put the green colored blocks in the yellow bowl"),
        (2, 0.779, "put the green colored blocks in the yellow bowl"),
        (2, 0.78, "put the green-coloured blocks in the yellow bowl"),
        (2, 0.839, "put the green-coloured blocks in the yellow bowl"),
        (2, 0.84, "put the blocks that are green in the yellow bowl"),
        (2, 0.919, "put the blocks that are green in the yellow bowl"),
        (3, 0.149, "put the green blocks in the yellow bowls"),
        (4, 0.84, "put the green blocks in the bowl that is yellow"),
        (8, 0.249, "Put the green blocks in the yellow bowl"),
        (9, 0.199, "put the green blocks in the yellow bowl."),
    ],
)
def test_a_share_to_either_side(at: int, share: float, said: str) -> None:
    dice = Dice([*SHARES[:at], share, *SHARES[at + 1 :]], CHOICES)
    assert paraphrase(CANONICAL, dice) == said  # type: ignore[arg-type]
    assert said == CANONICAL or (not dice.shares and not dice.choices)


@pytest.mark.parametrize(
    ("shares", "choices", "said"),
    [
        ([*SHARES[:2], 0.92, 0.49, *SHARES[3:]], CHOICES, "put the blocks which are green in the yellow bowl"),
        ([*SHARES[:2], 0.92, 0.5, *SHARES[3:]], CHOICES, "put the blocks in green in the yellow bowl"),
        (
            [0.1, 0.5, 0.92, 0.49, *SHARES[3:]],
            CHOICES,
            "put the block which is green in the yellow bowl",
        ),
        ([*SHARES[:6], 0.349, *SHARES[7:]], [*CHOICES, 0], "please put the green blocks in the yellow bowl"),
        ([*SHARES[:7], 0.299, *SHARES[8:]], [*CHOICES, 1], "put the green blocks in the yellow bowl, please"),
        ([*SHARES[:7], 0.299, 0.25, 0.0], [*CHOICES, 8], "put the green blocks in the yellow bowl!"),
        ([*SHARES[:5], 0.6, *SHARES[7:]], CHOICES, "the green blocks go in the yellow bowl"),  # never greeted
        ([0.1, 0.5, *SHARES[2:5], 0.6, *SHARES[7:]], CHOICES, "the green block goes in the yellow bowl"),
        (
            [*SHARES[:5], 0.6, *SHARES[7:]],
            [0, 0, 0, 0, 1, 0, 2],
            "the green blocks belong into the yellow bowl",
        ),
        (
            [0.1, 0.5, *SHARES[2:5], 0.6, *SHARES[7:]],
            [1, 2, 7, 8, 1, 0, 2],
            "every green cube belongs into yellow plate",
        ),
        (SHARES, [0, 0, 0, 0, 10, 0, 3], "make sure the green blocks are inside the yellow bowl"),
        ([0.1, 0.5, *SHARES[2:]], [0, 0, 0, 0, 10, 0, 3], "make sure the green block is inside the yellow bowl"),
        (SHARES, [3, 2, 0, 3, 0, 18, 6], "sort all green bricks to each yellow bowl"),
    ],
)
def test_a_wording_of_its_choices(shares: list[float], choices: list[int], said: str) -> None:
    dice = Dice(shares, choices)
    assert paraphrase(CANONICAL, dice) == said  # type: ignore[arg-type]
    assert not dice.shares and not dice.choices


@pytest.mark.parametrize(("greeted", "said"), [(0.349, "please "), (0.35, "")])
def test_a_wording_of_another_task_is_dressed_too(greeted: float, said: str) -> None:
    """The first pattern of the task, with the first verbs; greeted as it begins with a verb."""
    plain = paraphrase("pack the yo-yo in the brown box", Dice([0.1, 1.0, 1.0, 1.0, 1.0], [0, 0, 0]))  # type: ignore[arg-type]
    dice = Dice([0.1, greeted, 0.3, 0.25, 0.2], [0, 0, 0, 0] if said else [0, 0, 0])
    assert paraphrase("pack the yo-yo in the brown box", dice) == said + plain  # type: ignore[arg-type]
    assert not dice.shares and not dice.choices and "yo-yo" in plain


def test_wordings_are_spread_as_their_shares_say() -> None:
    """Of 4000: a tenth unchanged and more by chance, a quarter of the others with a capital."""
    rng = np.random.default_rng(0)
    found = [paraphrase(CANONICAL, rng) for _ in range(4000)]
    assert 0.09 < np.mean([text == CANONICAL for text in found]) < 0.12
    assert 0.20 < np.mean([text[0].isupper() for text in found]) < 0.25
