"""A trained policy: an observation and an instruction in, a pick and a place out. It knows no data set and no ROS."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional as F

from cliport_perception.heightmap import Heightmap
from cliport_perception.pose import PlanarPose
from cliport_perception.workspace import WorkspaceSpec
from cliport_policy.action import AffordanceMaps, PickPlaceAction
from cliport_policy.checkpoint import ANCHORS, Card, load_checkpoint, resolve_checkpoint
from cliport_policy.errors import CheckpointError, InstructionError, ObservationError
from cliport_policy.language import ENCODER_NAME, TextEncoder, TokenEmbeddings, shared_encoder
from cliport_policy.networks.factory import restore_network
from cliport_policy.networks.policy_network import PolicyNetwork
from cliport_policy.networks.rotation import bin_angles
from cliport_policy.observation import observation_tensor

MAX_INSTRUCTION_LENGTH = 1000
CONFIDENCE_RADIUS = 0.03  # m


class _Peak(NamedTuple):
    """The best cell of a map: pixel (row, col) on the full grid and the mass within 3 cm of it."""

    pixel: tuple[int, int]
    confidence: float


class Policy:
    """Locator, rotator and transport behind one call. Made by load_policy."""

    def __init__(self, network: PolicyNetwork, anchors: Tensor, card: Card, encoder: TextEncoder) -> None:
        self.card = card
        self._network = network.eval().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._anchors = anchors  # (A, 384) unit sentence vectors of training instructions
        self._encoder = encoder

    @property
    def workspace(self) -> WorkspaceSpec:
        """The grid that observations must have."""
        return self.card.workspace

    def check_instruction(self, instruction: str) -> None:
        """Raise InstructionError, in one line, for a text that this policy should not act on."""
        self._embed(instruction)

    def similarity(self, instruction: str) -> float:
        """Cosine similarity, in [-1, 1], of an instruction to the nearest of those the policy was trained on."""
        return self._similarity(self._encoder.encode_one(instruction))

    @torch.inference_mode()
    def infer(
        self, observation: Heightmap, instruction: str, with_maps: bool = False, goal: Heightmap | None = None
    ) -> PickPlaceAction:
        """The next pick and place for an instruction, and for an image of the goal where the network reads one.

        A network without a rotator leaves the pick's yaw at 0.
        Raises InstructionError for a text it refuses, and ObservationError for a heightmap of another workspace
        or one that shows nothing.
        """
        self._embed(instruction)
        image = self._tensor(observation)
        aim = self._network.encode_goal([instruction.strip()], self._goal_tensor(goal))
        cell = self._network.cell_size
        size = (image.shape[-2] // cell, image.shape[-1] // cell)

        mass = F.softmax(self._network.score_picks(image, aim)[0].float(), dim=0)  # (h w + 1,)
        done = float(mass[-1])
        pick_cells = (mass[:-1] / mass[:-1].sum().clamp_min(1e-12)).reshape(size).numpy()
        pick = self._peak(pick_cells)
        pixel = torch.tensor([pick.pixel], dtype=torch.float32)
        yaws, places = self._network.score_rotations(image, aim, pixel)
        pick_yaw = 0.0 if yaws is None else self._angle(int(yaws[0].argmax()))
        scores = places[0].float()  # (k, h, w)
        place_mass = F.softmax(scores.flatten(), dim=0).reshape(scores.shape).numpy()
        rotation = int(np.unravel_index(place_mass.argmax(), place_mass.shape)[0])
        place = self._peak(place_mass[rotation])
        place_yaw = math.remainder(pick_yaw + self._angle(rotation), 2 * math.pi)
        return PickPlaceAction(
            pick=PlanarPose(*self.workspace.pixel_to_xy(*pick.pixel), pick_yaw),
            place=PlanarPose(*self.workspace.pixel_to_xy(*place.pixel), place_yaw),
            pick_pixel=pick.pixel,
            place_pixel=place.pixel,
            pick_confidence=pick.confidence,
            place_confidence=place.confidence,
            done_probability=done,
            maps=self._maps(pick_cells, place_mass.max(0)) if with_maps else None,
        )

    def _embed(self, instruction: str) -> TokenEmbeddings:
        text = instruction.strip()
        if not text:
            raise InstructionError("the instruction is empty: say what to put where")
        if len(text) > MAX_INSTRUCTION_LENGTH:
            raise InstructionError(
                f"the instruction has {len(text)} characters: at most {MAX_INSTRUCTION_LENGTH} are read"
            )
        embeddings = self._encoder.encode_one(text)
        similarity = self._similarity(embeddings)
        if similarity < self.card.min_similarity:
            shown = text if len(text) <= 60 else text[:57] + "..."
            raise InstructionError(
                f"the instruction '{shown}' is unlike anything this policy was trained on (similarity "
                f"{similarity:.2f} < {self.card.min_similarity:.2f}): say it like 'put the red blocks in a green bowl'"
            )
        return embeddings

    def _similarity(self, embeddings: TokenEmbeddings) -> float:
        return float((self._anchors @ embeddings.sentence_vectors()[0]).max())

    def _check_observation(self, observation: Heightmap) -> None:
        if observation.workspace != self.workspace:
            raise ObservationError(
                f"the observation's workspace {observation.workspace} is not the policy's {self.workspace}: "
                "use the workspace file that the policy was trained with"
            )
        if not observation.valid.any():
            raise ObservationError("the observation has no valid cell: is the camera's depth image empty?")

    def _tensor(self, observation: Heightmap) -> Tensor:
        self._check_observation(observation)
        return observation_tensor(observation).to(memory_format=torch.channels_last)

    def _goal_tensor(self, goal: Heightmap | None) -> Tensor | None:
        if goal is None and self._network.needs_goal_image:
            raise ObservationError("this policy acts on an image of the goal: hand the goal's heightmap to infer")
        return None if goal is None else self._tensor(goal)

    def _angle(self, index: int) -> float:
        """Of a rotation bin [rad]."""
        return float(bin_angles(self.card.network.n_rotations)[index])

    def _peak(self, cells: NDArray[np.float32]) -> _Peak:
        """Best cell of a map as a full pixel, refined by the mean of its neighbourhood where cells are coarser."""
        row, col = (int(i) for i in np.unravel_index(cells.argmax(), cells.shape))
        cell = self._network.cell_size
        reach = 1 if cell > 1 else 0
        rows = np.arange(max(row - reach, 0), min(row + reach + 1, cells.shape[0]))
        cols = np.arange(max(col - reach, 0), min(col + reach + 1, cells.shape[1]))
        near = cells[np.ix_(rows, cols)]
        total = float(near.sum())
        mean_row = float((near.sum(1) * rows).sum()) / total
        mean_col = float((near.sum(0) * cols).sum()) / total
        pixel = (
            min(max(round(cell * mean_row + (cell - 1) / 2), 0), self.workspace.rows - 1),
            min(max(round(cell * mean_col + (cell - 1) / 2), 0), self.workspace.cols - 1),
        )
        radius = CONFIDENCE_RADIUS / (cell * self.workspace.pixel_size)
        grid_rows, grid_cols = np.ogrid[: cells.shape[0], : cells.shape[1]]
        disc = (grid_rows - row) ** 2 + (grid_cols - col) ** 2 <= radius**2
        return _Peak(pixel, min(float(cells[disc].sum()), 1.0))

    def _maps(self, pick: NDArray[np.float32], place: NDArray[np.float32]) -> AffordanceMaps:
        return AffordanceMaps(self._full_size(pick), self._full_size(place))

    def _full_size(self, cells: NDArray[np.float32]) -> NDArray[np.float32]:
        up = F.interpolate(
            torch.from_numpy(cells)[None, None], self.workspace.shape, mode="bilinear", align_corners=False
        )[0, 0].numpy()
        return np.asarray(up / max(float(up.sum()), 1e-12), np.float32)


def load_policy(path_or_name: str | Path = "default", precision: str = "auto") -> Policy:
    """A policy from a .safetensors file, a training folder, a shipped name or `default`.

    precision: as restore_network takes it. Raises CheckpointError where the file is missing, damaged or made for
    another encoder, and EncoderError where a network's frozen encoders are not at hand.
    """
    path = resolve_checkpoint(path_or_name)
    tensors, card = load_checkpoint(path)
    if card.encoder != ENCODER_NAME:
        raise CheckpointError(f"checkpoint {path} needs the text encoder {card.encoder!r}; here is {ENCODER_NAME!r}")
    anchors = tensors.pop(ANCHORS, None)
    if anchors is None:
        raise CheckpointError(f"checkpoint {path} lacks {ANCHORS}: train again")
    network = restore_network(card.network, tensors, card.frozen, path, precision)
    return Policy(network, anchors.clone(), card, shared_encoder())  # a view would keep the whole file in memory
