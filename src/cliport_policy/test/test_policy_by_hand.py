"""What a policy makes of its network's scores: pixels, yaws, confidences and null actions, by hand."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from cliport_core.action import Primitive
from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.card import Card
from cliport_policy.config import NetworkConfig
from cliport_policy.errors import ConfigError, InstructionError, ObservationError
from cliport_policy.networks.policy_network import Goal, PolicyNetwork
from cliport_policy.observation import observation_tensor, stack_channels, unscaled, without_heights, without_mask
from cliport_policy.policy import Policy

SPEC = WorkspaceSpec(x_min=0.0, x_max=0.4, y_min=0.0, y_max=0.8, pixel_size=0.02)  # 40 x 20 pixels, 20 x 10 cells
CELLS = (20, 10)


class Scripted(PolicyNetwork):
    """Scores that were written down: log probabilities up to a constant."""

    cell_size = 2

    def __init__(self, n_null: int, rotator: bool, primitives: list[float] | None) -> None:
        super().__init__()
        self.config = NetworkConfig(n_rotations=8)
        self.n_null, self.rotator, self.primitives = n_null, rotator, primitives
        self.asked: list[Any] = []

    def encode_goal(self, sentences: Any, images: Tensor | None = None) -> Goal:
        self.asked.append(sentences)
        return Goal()

    def score_picks(self, images: Tensor, goal: Goal) -> Tensor:
        cells = torch.full(CELLS, -20.0)
        cells[5, 4] = math.log(8)
        cells[15, 2] = math.log(4)  # far away
        nulls = [math.log(2), math.log(6)][: self.n_null]
        return torch.cat((cells.flatten(), torch.tensor(nulls)))[None]

    def score_primitives(self, images: Tensor, goal: Goal) -> Tensor | None:
        return None if self.primitives is None else torch.tensor([self.primitives])

    def score_yaws(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor | None:
        self.asked.append(pick.tolist())
        yaws = torch.zeros(1, 8)
        yaws[0, 3] = math.log(5)
        return yaws if self.rotator else None

    def score_places(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor:
        places = torch.full((1, 8, *CELLS), -20.0)
        places[0, 6, 12, 7] = math.log(3)
        places[0, 1, 2, 2] = math.log(2)
        places[0, 2, 12, 7] = math.log(1)
        return places


def policy(n_null: int = 2, rotator: bool = True, primitives: list[float] | None = None, **card: Any) -> Policy:
    network = Scripted(n_null, rotator, primitives)
    vector = SimpleNamespace(sentence_vectors=lambda: torch.tensor([[0.5, 0.0]]))
    encoder = SimpleNamespace(encode_one=lambda text: vector)
    made = Card(network.config, SPEC, "e", 0.45, **card)
    return Policy(network, torch.tensor([[1.0, 0.0], [0.0, 1.0]]), made, encoder)  # type: ignore[arg-type]


def seen() -> Heightmap:
    return Heightmap(np.zeros((40, 20, 3), np.uint8), np.zeros((40, 20), np.float32), np.ones((40, 20), bool), SPEC)


def test_an_action_by_hand() -> None:
    """The pick's yaw is bin 3 of 8; the place is at bin 6 relative to it: 135 + 270 degrees are 45."""
    made = policy()
    found = made.infer(seen(), " put it there ", with_maps=True)
    row, col = found.pick_pixel
    assert made._network.asked == [["put it there"], [[row, col]]]
    assert (row // 2, col // 2) == (5, 4) and [at // 2 for at in found.place_pixel] == [12, 7]
    assert (found.action.pick.x, found.action.pick.y) == pytest.approx(((col + 0.5) * 0.02, (row + 0.5) * 0.02))
    assert found.action.pick.yaw == pytest.approx(math.radians(135))
    assert found.action.place.yaw == pytest.approx(math.radians(45))
    assert found.pick_confidence == pytest.approx(8 / 12, rel=1e-4)  # of the cells alone
    assert found.place_confidence == pytest.approx(4 / 6, rel=1e-4)  # whatever the rotation
    assert found.action.confidence == found.confidence == min(found.pick_confidence, found.place_confidence)
    assert found.done_probability == pytest.approx(2 / 20, rel=1e-4)
    assert found.absent_probability == pytest.approx(6 / 20, rel=1e-4)
    assert found.maps is not None and found.maps.pick.shape == found.maps.place.shape == (40, 20)
    assert float(found.maps.pick.sum()) == pytest.approx(1, abs=1e-5)
    assert np.unravel_index(found.maps.place.argmax(), (40, 20))[0] in (24, 25)


def test_distributions_of_an_explanation() -> None:
    found = policy().explain(seen(), "put it there")
    assert found.yaws is not None and found.yaws[3] == pytest.approx(5 / 12) and found.yaws.sum() == pytest.approx(1)
    assert found.rotations[[6, 1, 2]] == pytest.approx([3 / 6, 2 / 6, 1 / 6], rel=1e-4)
    assert found.inference.maps is not None and policy().infer(seen(), "x").maps is None


def test_temperatures_change_confidences_only() -> None:
    found = policy(temperatures={"pick": 0.5, "place": 2.0}).infer(seen(), "put it there")
    assert found.pick_confidence == pytest.approx(64 / 80, rel=1e-3)
    root = [math.sqrt(share) for share in (3, 1, 2)]
    rest = (8 * 200 - 3) * math.exp(-10)
    assert found.place_confidence == pytest.approx((root[0] + root[1]) / (sum(root) + rest), rel=5e-3)
    assert found.done_probability == pytest.approx(2 / 20, rel=1e-4) and found.place_pixel[0] // 2 == 12


@pytest.mark.parametrize(("n_null", "done", "absent"), [(1, 2 / 14, 0.0), (2, 0.1, 0.3)])
def test_null_actions_are_told_apart_where_the_network_does(n_null: int, done: float, absent: float) -> None:
    found = policy(n_null=n_null).infer(seen(), "put it there")
    assert (found.done_probability, found.absent_probability) == pytest.approx((done, absent), rel=1e-4)


def test_a_bias_of_done_counts_for_its_primitive_alone() -> None:
    """Twice the odds of done: 4 to 18, where they were 2 to 18. What is not here it leaves."""
    bias = {"pick_place": math.log(2), "sweep": 5.0}
    found = policy(done_bias=bias).infer(seen(), "put it there")
    assert (found.done_probability, found.absent_probability) == pytest.approx((4 / 22, 6 / 20), rel=1e-4)
    assert found.pick_confidence == pytest.approx(8 / 12, rel=1e-4)
    made = policy(primitives=[0.0, 0.0, 9.0], done_bias=bias)
    assert made.infer(seen(), "put it there").done_probability == pytest.approx(2 / 20, rel=1e-4)
    for wrong in ({"push": 1.0}, {"sweep": math.inf}, {"fold": math.nan}, {"sweep": -20.1}):
        with pytest.raises(ConfigError, match="a done_bias must lie in ±20 and be of pick_place or sweep or fold"):
            policy(done_bias=wrong)


def test_a_network_without_a_rotator_leaves_the_yaw() -> None:
    made = policy(rotator=False, primitive=Primitive.SWEEP)
    found = made.explain(seen(), "put it there")
    action = found.inference.action
    assert found.yaws is None and action.pick.yaw == 0.0 and action.primitive is Primitive.SWEEP
    assert action.place.yaw == pytest.approx(math.radians(-90))
    assert policy(primitives=[0.0, 1.0, 2.0]).infer(seen(), "x").action.primitive is Primitive(2)


def test_a_sentence_is_taken_at_the_least_similarity() -> None:
    made = policy()
    object.__setattr__(made.card, "min_similarity", 0.5)
    assert made.similarity("put it there") == 0.5
    made.check_instruction("put it there")
    object.__setattr__(made.card, "min_similarity", 0.9)
    made.check_instruction("put it there")  # accepted before
    with pytest.raises(InstructionError, match=r"'put it here' is unlike .* \(similarity 0\.50 < 0\.90\)") as caught:
        made.check_instruction("put it here")
    assert "say it like 'put the red blocks in a green bowl'" in str(caught.value)


def test_a_sentence_below_the_least_similarity_is_refused() -> None:
    made = policy()
    object.__setattr__(made.card, "min_similarity", 0.51)
    with pytest.raises(InstructionError, match="is unlike anything"):
        made.check_instruction("put it there")


@pytest.mark.parametrize(("length", "shown"), [(60, "x" * 60), (61, "x" * 57 + "...")])
def test_a_long_sentence_is_shown_in_part(length: int, shown: str) -> None:
    made = policy()
    object.__setattr__(made.card, "min_similarity", 0.9)
    with pytest.raises(InstructionError, match=rf"^the instruction '{shown}' is unlike"):
        made.check_instruction("x" * length)


def test_an_observation_is_one_of_the_policys_workspace() -> None:
    view = seen()
    view.height[3, 4] = math.inf
    with pytest.raises(ObservationError, match="not all numbers"):
        policy().infer(view, "x")


def test_channels_by_hand() -> None:
    """Grey is 0, 64 more is 1; a block's 4 cm are 1."""
    color = np.array([[[127, 191, 255], [10, 20, 30]]], np.uint8)
    channels = stack_channels(color, np.float32([[0.04, 0.1]]), np.array([[True, False]]))
    np.testing.assert_allclose(channels[0], [[-0.5 / 64, 63.5 / 64, 127.5 / 64, 1.0, 1.0], [0] * 5])
    spec = WorkspaceSpec(x_min=0.0, x_max=0.04, y_min=0.0, y_max=0.02, pixel_size=0.02)
    image = observation_tensor(Heightmap(color, np.float32([[0.04, 0.1]]), np.array([[True, False]]), spec))
    assert image.shape == (1, 5, 1, 2)
    back = unscaled(image)[0, :, 0]
    np.testing.assert_allclose(back[:, 0], [127 / 255, 191 / 255, 1.0, 0.04], rtol=1e-6)
    assert (back[:, 1] == 0).all()
    assert without_heights(image)[0, 3:, 0].tolist() == [[0, 0], [1, 0]]
    assert without_mask(image)[0, 3:, 0].tolist() == [[1, 0], [1, 1]]
    for blind in (without_heights(image), without_mask(image)):
        assert torch.equal(blind[:, :3], image[:, :3])
