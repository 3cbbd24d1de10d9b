"""Targets and losses: symmetric yaws are equally right, and the loss falls to its floor at the target."""

import math

import pytest
import torch
from torch import Tensor, nn

from cliport_core.action import Primitive
from cliport_policy.config import NetworkConfig, TrainConfig
from cliport_policy.data.batches import Batch
from cliport_policy.networks.policy_network import Goal, Placings
from cliport_policy.networks.rotation import straight_cells
from cliport_policy.training.losses import (
    WRONG_PLACES,
    WRONG_TURNS,
    cell_label,
    compute_losses,
    soft_cells,
    soft_cross_entropy,
    turn_target,
    wrong_places,
    yaw_label,
    yaw_target,
)


def test_a_cubes_four_yaws_share_the_target() -> None:
    target = yaw_target(torch.tensor([math.radians(20)]), torch.tensor([math.pi / 2]), 36)[0]
    best = sorted(target.topk(4).indices.tolist())
    assert best == [2, 11, 20, 29]
    assert math.isclose(float(target.sum()), 1, abs_tol=1e-5)


def test_a_grippers_half_turn_is_always_right() -> None:
    target = yaw_target(torch.tensor([0.0]), torch.tensor([2 * math.pi]), 36)[0]
    assert torch.isclose(target[0], target[18])
    assert target[9] < 1e-6


def test_cells_are_centred_on_the_pixel() -> None:
    cells = soft_cells(torch.tensor([[41.0, 20.5]]), (160, 80))[0]
    rows = (cells.sum(1) * torch.arange(160)).sum()
    cols = (cells.sum(0) * torch.arange(80)).sum()
    assert float(rows) == pytest.approx((41.0 - 0.5) / 2, abs=1e-3)
    assert float(cols) == pytest.approx((20.5 - 0.5) / 2, abs=1e-3)


def test_a_pixel_far_outside_gives_no_target() -> None:
    assert float(soft_cells(torch.tensor([[-400.0, 900.0]]), (160, 80)).sum()) == 0


def test_cross_entropy_is_lowest_at_the_target() -> None:
    target = torch.tensor([[0.7, 0.2, 0.1]])
    at_target = soft_cross_entropy(target.log(), target)
    assert at_target < soft_cross_entropy(torch.tensor([[0.5, 0.3, 0.2]]).log(), target)


def test_labels_are_one_cell_and_one_bin() -> None:
    cells = cell_label(torch.tensor([[41.4, 20.6], [-400.0, 900.0]]), (160, 80))
    assert cells[0].sum() == 1 and cells[0, 20, 10] == 1 and cells[1].sum() == 0
    yaws = torch.tensor([math.radians(20), math.radians(200)])
    labels = yaw_label(yaws, torch.full((2,), 2 * math.pi), 36)
    assert labels.argmax(1).tolist() == [2, 2] and labels.sum(1).tolist() == [1, 1]


class _Flat(nn.Module):
    """A network that knows nothing: all scores are 0; it notes which rotations it was asked for."""

    cell_size = 2
    n_null = 1
    has_aligner = False

    def __init__(self, k: int = 8) -> None:
        super().__init__()
        self.config = NetworkConfig(n_rotations=k)
        self.asked: list[Tensor] = []

    def encode_goal(self, phrases: list[str], images: Tensor | None = None) -> Goal:
        return Goal()

    def look(self, images: Tensor, goal: Goal) -> Goal:
        return goal

    def score_picks(self, images: Tensor, goal: Goal) -> Tensor:
        return torch.zeros(len(images), 20 * 10 + self.n_null)

    def score_primitives(self, images: Tensor, goal: Goal) -> Tensor | None:
        return None

    def score_yaws(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor:
        return torch.zeros_like(angles)

    def score_places(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor:
        self.asked.append(angles)
        return torch.zeros(*angles.shape, 20, 10)


def _batch(n: int) -> Batch:
    pixels = torch.full((n, 2), 9.0)
    done = torch.arange(n) % 3 == 2
    period = torch.full((n,), math.pi)
    return Batch(
        torch.zeros(n, 5, 40, 20), ["x"] * n, done, pixels, torch.zeros(n), period, pixels,
        torch.full((n,), math.pi / 2), torch.arange(n),
    )  # fmt: skip


def _part(batch: Batch, rows: slice) -> Batch:
    return Batch(*(None if value is None else value[rows] for value in batch))


def test_losses_of_ignorance_are_logarithms_of_the_choices() -> None:
    for rotations, k in ((0, 8), (3, 3)):
        config = TrainConfig(rotator_rotations=rotations, transport_rotations=rotations)
        losses = compute_losses(_Flat(), _batch(4), config)  # type: ignore[arg-type]
        # three samples of four show an action, one a finished scene
        expected = (0.75 * math.log(201), math.log(k), math.log(200 * k), 0.25 * math.log(201), 0.0, 0.0, 0.0)
        assert [float(loss) for loss in losses] == pytest.approx(expected, rel=1e-5)


class _Knowing(_Flat):
    """A network that says "done" where nothing is to be seen, and sweeps."""

    n_null = 2

    def score_picks(self, images: Tensor, goal: Goal) -> Tensor:
        scores = super().score_picks(images, goal)
        scores[:, -2] = 9.0
        return scores

    def score_primitives(self, images: Tensor, goal: Goal) -> Tensor | None:
        return torch.tensor([0.0, 4.0, 0.0]).expand(len(images), 3)


def test_done_and_not_here_are_two_labels_and_the_primitive_is_a_third() -> None:
    batch = _batch(3)._replace(
        done=torch.tensor([False, False, True]),
        absent=torch.tensor([False, True, False]),
        primitive=torch.tensor([1, 0, 0]),
    )
    assert batch.acts.tolist() == [True, False, False]
    losses = compute_losses(_Knowing(), batch, TrainConfig())  # type: ignore[arg-type]
    norm = math.log(201 + math.exp(9))
    assert float(losses.done) == pytest.approx((norm - 9) / 3, rel=1e-4)
    assert float(losses.absent) == float(losses.locator) == pytest.approx(norm / 3, rel=1e-4)
    assert float(losses.primitive) == pytest.approx(math.log(2 + math.exp(4)) - 4, rel=1e-4)


class _Turner(_Flat):
    """It knows the right rotation, and no more."""

    def score_places(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor:
        right = torch.isclose(angles, torch.tensor(math.pi / 2)).float()
        return super().score_places(images, goal, pick, angles) + 5 * right[..., None, None]


class _Aligner(_Flat):
    """It says that the right place fits at a quarter to the left, and nothing elsewhere; it keeps what it was asked."""

    has_aligner = True

    def __init__(self) -> None:
        super().__init__(36)
        self.asked_fits: list[Placings] = []

    def score_fits(self, images: Tensor, goal: Goal, placings: Placings) -> Tensor:
        self.asked_fits.append(placings)
        _, _, places, angles, _ = placings
        best = turn_target(torch.full((len(images),), math.pi / 2), 36)
        turns = best.gather(1, torch.round(angles / math.radians(10)).long()).clamp_min(1e-30).log()
        return torch.where((places - 9).norm(dim=-1) < 8, turns, -30.0)


@pytest.mark.parametrize("rotations", [0, 12])
def test_an_aligner_learns_the_turn_at_the_experts_place(rotations: int) -> None:
    best = turn_target(torch.tensor([math.pi / 2]), 36)
    entropy = -float((best * best.clamp_min(1e-30).log()).sum())
    assert best.argmax() == 9 and float(best.sum()) == pytest.approx(1) and 0.6 < entropy < 0.7
    network, batch = _Aligner(), _batch(4)
    config = TrainConfig(rotator_rotations=rotations, jitter=False)
    losses = compute_losses(network, batch, config)  # type: ignore[arg-type]
    ((pick, yaw, places, angles, _),) = network.asked_fits
    count = rotations or 36
    assert angles.shape == places.shape[:2] == (3, count + WRONG_PLACES * WRONG_TURNS)
    assert torch.equal(pick, batch.pick[batch.acts])
    assert torch.equal(places[:, :count], batch.place[batch.acts][:, None].expand(-1, count, 2))
    assert torch.allclose((yaw - batch.pick_yaw[batch.acts]).remainder(math.pi).sin(), torch.zeros(3), atol=1e-5)
    if not rotations:
        assert float(losses.fit) == pytest.approx(entropy, rel=1e-4)
    without = losses._replace(fit=torch.zeros(())).total()
    assert float(losses.total() - without) == pytest.approx(float(losses.fit), abs=1e-5)


def test_an_aligner_learns_from_picks_places_and_yaws_that_are_not_exact() -> None:
    network, batch = _Aligner(), _batch(40)
    compute_losses(network, batch, TrainConfig())  # type: ignore[arg-type]
    ((pick, yaw, places, angles, _),) = network.asked_fits
    for off in (pick - batch.pick[batch.acts], places[:, 0] - batch.place[batch.acts]):
        assert 0.7 < float(off.std()) < 1.3
    off = (yaw - batch.pick_yaw[batch.acts] + math.pi / 2).remainder(math.pi) - math.pi / 2
    assert 2.0 < math.degrees(float(off.std())) < 4.5
    turned = (yaw - batch.pick_yaw[batch.acts]).cos() < 0
    assert 0.2 < float(turned.float().mean()) < 0.8, "a gripper's yaw is either way round"
    wrong, turns = places[:, 12:], torch.round(angles[:, 12:] / math.radians(10))
    assert float((wrong - 9).norm(dim=-1).min()) >= 11, "a wrong place is not near the right one"
    assert torch.equal(wrong[:, 0], wrong[:, 2]) and not torch.equal(wrong[:, 0], wrong[:, 3])
    assert turns.min() == 0 and turns.max() == 35


def test_an_aligner_sees_pick_and_place_distorted_alike_and_every_other_pair_mirrored() -> None:
    network, batch = _Aligner(), _batch(300)
    for config in (TrainConfig(stretch_sigma=0.25), TrainConfig(bend_sigma_px=2.0), TrainConfig()):
        compute_losses(network, batch, config)  # type: ignore[arg-type]
    stretched, bent, none = (placings.cells for placings in network.asked_fits)
    assert none is None and stretched is not None and bent is not None
    straight = straight_cells(64)
    flat = straight.flatten(0, 1)
    found = torch.linalg.pinv(flat) @ stretched.flatten(1, 2)  # (200, 2, 2)
    assert torch.allclose(flat @ found, stretched.flatten(1, 2), atol=1e-3), "linear"
    assert torch.allclose(found, found.mT, atol=1e-5), "along two perpendicular axes"
    assert 0.4 < float((torch.linalg.det(found) < 0).float().mean()) < 0.6
    assert 0.2 < float(torch.linalg.svdvals(found).log().std()) < 0.3
    off = bent.norm(dim=-1) - straight.norm(dim=-1)
    assert 1.0 < float(off[:, 16:48, 16:48].std()) < 4.0
    assert float(bent[:, 31:33, 31:33].mean((1, 2)).norm(dim=-1).max()) < 0.5, "the middle stays"


class _Undecided(_Aligner):
    """It says that all fits alike."""

    def score_fits(self, images: Tensor, goal: Goal, placings: Placings) -> Tensor:
        return torch.zeros_like(placings.angles)


@pytest.mark.parametrize("rotations", [0, 12, 1])
def test_few_rotations_of_an_aligner_stand_for_all(rotations: int) -> None:
    config = TrainConfig(rotator_rotations=rotations)
    losses = compute_losses(_Undecided(), _batch(4), config)  # type: ignore[arg-type]
    at_right = 36 if rotations != 1 else 1
    assert float(losses.fit) == pytest.approx(math.log(at_right + 36 * WRONG_PLACES), rel=1e-5)


def test_an_aligner_learns_nothing_from_what_is_swept_or_folded() -> None:
    batch = _batch(4)  # three of them act
    placed = compute_losses(_Undecided(), batch, TrainConfig())  # type: ignore[arg-type]
    primitives = torch.tensor([Primitive.SWEEP, Primitive.PICK_PLACE, Primitive.PICK_PLACE, Primitive.FOLD])
    mixed = compute_losses(_Undecided(), batch._replace(primitive=primitives), TrainConfig())  # type: ignore[arg-type]
    assert float(mixed.fit) == pytest.approx(float(placed.fit) / 3)


def test_wrong_places_are_those_that_the_scores_prefer() -> None:
    scores = torch.zeros(2, 20, 10)
    scores[0, 4, 4], scores[0, 15, 7], scores[1, 19, 0], scores[1, 0, 9] = 40.0, 30.0, 30.0, 30.0 + math.log(3)
    place, noise = torch.tensor([[9.0, 9.0], [20.0, 10.0]]), torch.linspace(0.001, 0.999, 9).expand(2, -1)
    found = wrong_places(scores, place, 2, noise)
    assert found.shape == (2, 9, 2)
    assert found[0].unique(dim=0).tolist() == [[30.5, 14.5]], "the best cell is the right one"
    assert found[1].tolist() == [[0.5, 18.5]] * 7 + [[38.5, 0.5]] * 2


def test_a_turns_target_is_nearest_round_the_circle() -> None:
    target = turn_target(torch.tensor([math.radians(355), math.radians(-5), math.radians(182)]), 36)
    assert torch.allclose(target[0], target[1], atol=1e-5)
    assert float(target[0, 0]) == pytest.approx(float(target[0, 35]), abs=1e-5)
    assert int(target[2].argmax()) == 18 and float(target[2, 0]) < 1e-6, "half a turn is another one"


@pytest.mark.parametrize(("rotations", "k"), [(0, 8), (3, 3)])
def test_knowing_the_rotation_is_worth_it(rotations: int, k: int) -> None:
    config = TrainConfig(transport_rotations=rotations)
    losses = compute_losses(_Turner(), _batch(4), config)  # type: ignore[arg-type]
    assert float(losses.transport) == pytest.approx(math.log(200 * (math.exp(5) + k - 1)) - 5, rel=1e-5)


def test_the_right_rotation_competes_with_others_drawn_by_sample() -> None:
    network, config = _Flat(), TrainConfig(transport_rotations=3)
    compute_losses(network, _batch(4), config)  # type: ignore[arg-type]
    compute_losses(network, _part(_batch(4), slice(1, 4)), config)  # type: ignore[arg-type]
    whole, part = network.asked  # of samples 0, 1 and 3, and of 1 and 3
    assert torch.allclose(whole[:, 0], torch.tensor(math.pi / 2))
    assert all(len(set(row.tolist())) == 3 for row in whole)
    assert torch.equal(whole[1:], part)


def test_losses_of_parts_sum_up_to_the_whole() -> None:
    network, config, batch = _Flat(), TrainConfig(), _batch(6)
    whole = compute_losses(network, batch, config)  # type: ignore[arg-type]
    parts = [
        compute_losses(network, _part(batch, rows), config, 6, 4)  # type: ignore[arg-type]
        for rows in (slice(0, 2), slice(2, 3), slice(3, 6))
    ]
    for name in whole._fields:
        assert float(sum(getattr(part, name) for part in parts)) == pytest.approx(float(getattr(whole, name)))
