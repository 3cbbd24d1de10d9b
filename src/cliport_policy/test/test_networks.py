"""Geometry and shapes of the networks: what turns, turns the right way; what is batched, does not mix."""

import math
from dataclasses import replace

import pytest
import torch

from cliport_policy.config import NetworkConfig
from cliport_policy.errors import ConfigError
from cliport_policy.named_configs import load_network_config
from cliport_policy.networks.compact.network import CompactNetwork
from cliport_policy.networks.correlation import correlate_centered
from cliport_policy.networks.rotation import are_opposite_pairs, bin_angles, rotated_windows, straight_cells

SMALL = NetworkConfig(widths=(8, 12), goal_dim=16, crop_pixels=16, query_cells=9)


def test_window_turned_by_an_objects_yaw_shows_it_unrotated() -> None:
    yaw = math.radians(30)
    rows, cols = torch.meshgrid(torch.arange(61.0) - 30, torch.arange(61.0) - 30, indexing="ij")
    along = cols * math.cos(yaw) + rows * math.sin(yaw)
    across = -cols * math.sin(yaw) + rows * math.cos(yaw)
    bar = ((along.abs() <= 12) & (across.abs() <= 3)).float()[None, None]
    window = rotated_windows(bar, torch.tensor([[30.0, 30.0]]), torch.tensor([[yaw]]), 31)[0, 0, 0]
    assert window[15, 5] > 0.9 and window[15, 25] > 0.9  # the bar lies along the columns
    assert window[5, 15] < 0.1 and window[25, 15] < 0.1


def test_a_stretched_window_shows_the_map_along_its_own_axes() -> None:
    points = torch.zeros(1, 1, 41, 41)
    # 8 rows from the centre are 8 columns of a window turned by a quarter, and 4 of a stretched one.
    points[0, 0, 28, 20] = 1.0
    cells = (straight_cells(21) @ torch.diag(torch.tensor([2.0, -1.0])))[None]
    window = rotated_windows(points, torch.tensor([[20.0, 20.0]]), torch.tensor([[math.pi / 2]]), 21, cells)
    assert window[0, 0, 0].argmax() == 10 * 21 + 14 and window[0, 0, 0, 10, 14] == pytest.approx(1, abs=1e-4)
    assert torch.equal(
        rotated_windows(points, torch.tensor([[20.0, 20.0]]), torch.tensor([[0.3]]), 21),
        rotated_windows(points, torch.tensor([[20.0, 20.0]]), torch.tensor([[0.3]]), 21, straight_cells(21)[None]),
    )


def test_each_image_has_windows_of_its_own_place_turn_and_cells() -> None:
    generator = torch.Generator().manual_seed(0)
    maps, centers = torch.rand(3, 2, 40, 30, generator=generator), 30 * torch.rand(3, 4, 2, generator=generator)
    angles, cells = 6 * torch.rand(3, 4, generator=generator), 9 * torch.randn(3, 7, 7, 2, generator=generator)
    together = rotated_windows(maps, centers, angles, 7, cells)
    each = [rotated_windows(*(one[None] for one in ones), 7, own[None])[0]  # type: ignore[misc]
            for *ones, own in zip(maps, centers, angles, cells, strict=True)]  # fmt: skip
    torch.testing.assert_close(together, torch.stack(each))


def test_window_outside_the_map_is_zero() -> None:
    windows = rotated_windows(torch.ones(1, 2, 20, 20), torch.tensor([[0.0, 0.0]]), torch.zeros(1, 1), 9)
    assert windows.shape == (1, 1, 2, 9, 9)
    assert windows[0, 0, 0, 0, 0] == 0 and windows[0, 0, 0, 8, 8] == 1


@pytest.mark.parametrize("half_turns", [False, True])
def test_correlation_and_its_gradients_agree_with_a_direct_sum(half_turns: bool) -> None:
    generator = torch.Generator().manual_seed(0)
    key = torch.randn(2, 3, 14, 11, generator=generator, dtype=torch.float64, requires_grad=True)
    window = torch.randn(2, 8, 3, 5, 5, generator=generator, dtype=torch.float64, requires_grad=True)
    windows = torch.cat((window, window.flip(-1, -2)), dim=1) if half_turns else window
    direct = torch.stack([torch.nn.functional.conv2d(key[i : i + 1], windows[i], padding=2)[0] for i in range(2)])
    scores = correlate_centered(key, window, half_turns)
    assert torch.allclose(scores, direct)
    weights = torch.randn(scores.shape, generator=generator, dtype=torch.float64)
    found = torch.autograd.grad((scores * weights).sum(), (key, window))
    for a, b in zip(found, torch.autograd.grad((direct * weights).sum(), (key, window)), strict=True):
        assert torch.allclose(a, b)


def test_opposite_rotations_are_known() -> None:
    assert are_opposite_pairs(bin_angles(36).expand(3, -1)) and are_opposite_pairs(-bin_angles(4))
    assert not are_opposite_pairs(bin_angles(5)) and not are_opposite_pairs(bin_angles(36)[[0, 18, 3, 20]])


def test_all_rotations_at_once_are_each_alone() -> None:
    """Half of the windows serve two rotations each."""
    transport = CompactNetwork(SMALL).eval().transport
    x, goal, pick = torch.randn(2, 5, 32, 16), torch.randn(2, 32), torch.tensor([[10.0, 8.0], [3.0, 2.0]])
    angles = bin_angles(6).expand(2, -1)
    with torch.no_grad():
        alone = torch.cat([transport(x, goal, pick, angles[:, i : i + 1]) for i in range(6)], dim=1)
        assert torch.allclose(transport(x, goal, pick, angles), alone, atol=1e-4)


def test_shapes_of_every_network() -> None:
    network = CompactNetwork(SMALL).eval()
    x = torch.randn(2, 5, 32, 16)
    goal = network.read_goal(torch.randn(2, 7, 384), torch.ones(2, 7, dtype=torch.bool))
    pick = torch.tensor([[10.0, 8.0], [3.0, 2.0]])
    angles = bin_angles(6).expand(2, -1)
    assert network.locator(x, goal).shape == (2, 16 * 8 + 1)
    assert network.rotator(x, goal, pick, angles).shape == (2, 6)
    assert network.transport(x, goal, pick, angles).shape == (2, 6, 16, 8)


def test_batch_entries_do_not_mix() -> None:
    network = CompactNetwork(SMALL).eval()
    x = torch.randn(3, 5, 32, 16)
    tokens, mask = torch.randn(3, 7, 384), torch.ones(3, 7, dtype=torch.bool)
    mask[1, 4:] = False
    with torch.no_grad():
        together = network.locator(x, network.read_goal(tokens, mask))
        alone = network.locator(x[1:2], network.read_goal(tokens[1:2, :4], mask[1:2, :4]))
    assert torch.allclose(together[1:2], alone, atol=1e-4)


def test_padding_tokens_do_not_change_the_goal() -> None:
    network = CompactNetwork(SMALL).eval()
    tokens = torch.randn(1, 4, 384)
    padded = torch.cat((tokens, torch.randn(1, 3, 384)), dim=1)
    mask = torch.tensor([[True] * 4 + [False] * 3])
    with torch.no_grad():
        assert torch.allclose(network.read_goal(tokens, mask[:, :4]), network.read_goal(padded, mask), atol=1e-5)


@pytest.mark.parametrize("values", [{"widths": (8,)}, {"query_cells": 8}, {"crop_pixels": 20}, {"n_rotations": 0}])
def test_impossible_settings_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(ConfigError):
        NetworkConfig(**values)  # type: ignore[arg-type]


def test_unknown_setting_is_named() -> None:
    with pytest.raises(ConfigError, match="depth"):
        NetworkConfig.from_dict({"depth": 3})


@pytest.mark.parametrize(
    ("change", "feels_words", "feels_heights", "feels_mask"),
    [
        ({}, True, True, True),
        ({"language": False}, False, True, True),
        ({"heights": False}, True, False, True),
        ({"heights": False, "mask": False}, True, False, False),
    ],
    ids=["whole", "without language", "without heights", "without depth"],
)
def test_an_ablation_is_blind_to_what_was_taken_from_it(
    change: dict[str, bool], feels_words: bool, feels_heights: bool, feels_mask: bool
) -> None:
    torch.manual_seed(0)
    network = CompactNetwork(replace(SMALL, **change)).eval()
    images, pick = torch.randn(1, 5, 32, 16), torch.tensor([[10.0, 8.0]])
    flat = images.clone()
    flat[:, 3] += torch.rand(32, 16)
    torn = images.clone()
    torn[:, 4] += torch.rand(32, 16)

    def scores(sentence: str, image: torch.Tensor) -> list[torch.Tensor]:
        with torch.no_grad():
            goal = network.encode_goal([sentence])
            yaws, places = network.score_rotations(image, goal, pick)
            assert yaws is not None
            return [network.score_picks(image, goal), yaws, places]

    before = scores("put the red block in the green bowl", images)
    other_words = scores("push the pile of blocks", images)
    other_heights = scores("put the red block in the green bowl", flat)
    assert [torch.equal(a, b) for a, b in zip(before, other_words, strict=True)] == [not feels_words] * 3
    assert [torch.equal(a, b) for a, b in zip(before, other_heights, strict=True)] == [not feels_heights] * 3
    other_mask = scores("put the red block in the green bowl", torn)
    assert [torch.equal(a, b) for a, b in zip(before, other_mask, strict=True)] == [not feels_mask] * 3


def test_the_ablation_without_height_gets_nothing_of_the_depth_and_old_cards_keep_their_mask() -> None:
    shipped = load_network_config("compact_wo_height")
    assert isinstance(shipped, NetworkConfig) and not shipped.heights and not shipped.mask
    assert NetworkConfig.from_dict({"heights": False}).mask
