"""Scenes in colours of a survey: names that no demonstration used, colours that a person can tell apart."""

from itertools import combinations

import numpy as np
import pytest

from cliport_benchmark.errors import OptionError
from cliport_benchmark.evaluate import EvaluateConfig, Evaluator
from cliport_benchmark.kinematic_hand import KinematicHand
from cliport_benchmark.own_setup import condition_words
from cliport_benchmark.survey_colors import LEAST_DISTANCE, draw_colors, names_of_survey, paint_of
from cliport_benchmark.wording import Wording
from cliport_policy.data.color_names import lab, survey
from sim_bridge.colors import COLORS
from sim_bridge.tasks import make_task

BOWLS = "put-blocks-in-bowls-seen-colors"


def test_names_are_the_surveys_and_none_of_the_benchmarks() -> None:
    names = names_of_survey()
    assert len(names) > 800 and len(set(names)) == len(names) and set(names) <= set(survey())
    assert not set(names) & {*COLORS, "grey", "black"}
    assert {"dusty purple", "teal", "robin's egg blue"} <= set(names)
    assert not any(crude in name for name in names for crude in ("shit", "puke", "vomit"))


@pytest.mark.parametrize("seed", range(4))
def test_any_two_colours_can_be_told_apart(seed: int) -> None:
    names = draw_colors(make_task(BOWLS, "test"), seed)
    assert list(names) == [color for color in COLORS if color != "brown"]
    colors = lab(np.array([*map(paint_of, names.values()), COLORS["brown"], (74, 76, 80)], np.uint8))
    # Painted colours are rounded to whole numbers.
    assert min(np.linalg.norm(a - b) for a, b in combinations(colors, 2)) > LEAST_DISTANCE - 1.0
    assert draw_colors(make_task(BOWLS, "test"), seed) == names
    assert draw_colors(make_task(BOWLS, "val"), seed) != names != draw_colors(make_task(BOWLS, "test"), seed + 1)


def test_a_scene_is_painted_and_spoken_of_so_and_lies_where_it_lay() -> None:
    plain = Evaluator(EvaluateConfig("expert", BOWLS, "test", 5, 1))
    plain.hand = KinematicHand(plain.world, np.random.default_rng(0))
    was = plain.run(5)
    there = [(o.name, o.color, tuple(plain.world.object_xy(o))) for o in plain.world.objects]
    painted = Evaluator(EvaluateConfig("expert", BOWLS, "test", 5, 1, survey_colors=True))
    painted.hand = KinematicHand(painted.world, np.random.default_rng(0))
    outcome = painted.run(5)
    names = draw_colors(make_task(BOWLS, "test"), 5)
    assert [(o.name, o.color, tuple(painted.world.object_xy(o))) for o in painted.world.objects] == there
    looks = {color: paint_of(name) for color, name in names.items()}
    assert all(o.rgb == {**COLORS, **looks}[o.color] for o in painted.world.objects)
    assert outcome.score == was.score == 1.0  # type: ignore[union-attr]
    first, second = (word for word in was.instruction.split() if word in COLORS)  # type: ignore[union-attr]
    assert outcome.instruction == f"put the {names[first]} blocks in a {names[second]} bowl"  # type: ignore[union-attr]


def test_it_is_said_of_the_results_and_refused_where_it_cannot_be() -> None:
    settings = EvaluateConfig("expert", BOWLS, "test", 5, 1, survey_colors=True).settings()
    assert condition_words(settings) == ", colours of the survey"
    assert "survey_colors" not in EvaluateConfig("expert", BOWLS, "test", 5, 1).settings()
    with pytest.raises(OptionError, match="--synonyms and --survey-colors name the same colours: give one"):
        EvaluateConfig("expert", BOWLS, "test", 5, 1, Wording(synonyms={"red": "crimson"}), survey_colors=True)
    with pytest.raises(OptionError, match="--survey-colors cannot reword block-insertion: its sentences"):
        EvaluateConfig("expert", "block-insertion", "test", 5, 1, survey_colors=True)
    with pytest.raises(OptionError, match="whose names say their own colours"):
        EvaluateConfig("expert", "packing-seen-google-objects-seq", "test", 5, 1, survey_colors=True)


def test_a_brown_stand_is_still_called_brown() -> None:
    task = make_task("stack-block-pyramid-seq-seen-colors", "test")
    names = draw_colors(task, 3)
    said = Wording(synonyms=names).sentence(
        task.sentence_pattern, {"color": "green", "place": "the lightest brown block"}, 0
    )
    assert said == f"put the {names['green']} block on the lightest brown block"
