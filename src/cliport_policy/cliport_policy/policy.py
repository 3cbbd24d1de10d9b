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
from cliport_policy.networks.compact import CompactNetwork
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

    def __init__(self, network: CompactNetwork, anchors: Tensor, card: Card, encoder: TextEncoder) -> None:
        self.card = card
        self._network = network.eval().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._anchors = anchors  # (A, 384) unit sentence vectors of training instructions
        self._encoder = encoder
        self._angles = bin_angles(card.network.n_rotations)[None]  # (1, k)

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
    def infer(self, observation: Heightmap, instruction: str, with_maps: bool = False) -> PickPlaceAction:
        """The next pick and place for an instruction.

        Raises InstructionError for a text it refuses, and ObservationError for a heightmap of another workspace
        or one that shows nothing.
        """
        embeddings = self._embed(instruction)
        self._check_observation(observation)
        image = observation_tensor(observation).to(memory_format=torch.channels_last)
        goal = self._network.read_goal(embeddings.tokens, embeddings.mask)
        size = (image.shape[-2] // 2, image.shape[-1] // 2)

        mass = F.softmax(self._network.locator(image, goal)[0], dim=0)  # (h w + 1,)
        done = float(mass[-1])
        pick_cells = (mass[:-1] / mass[:-1].sum().clamp_min(1e-12)).reshape(size).numpy()
        pick = self._peak(pick_cells)
        pixel = torch.tensor([pick.pixel], dtype=torch.float32)
        yaw_logits = self._network.rotator(image, goal, pixel, self._angles)[0]
        pick_yaw = float(self._angles[0, int(yaw_logits.argmax())])
        scores = self._network.transport(image, goal, pixel, self._angles)[0]  # (k, h, w)
        place_mass = F.softmax(scores.flatten(), dim=0).reshape(scores.shape).numpy()
        rotation = int(np.unravel_index(place_mass.argmax(), place_mass.shape)[0])
        place = self._peak(place_mass[rotation])
        place_yaw = math.remainder(pick_yaw + float(self._angles[0, rotation]), 2 * math.pi)
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

    def _peak(self, cells: NDArray[np.float32]) -> _Peak:
        """Best cell of a half-resolution map, refined by the mean of its 3x3 neighbourhood, as a full pixel."""
        row, col = (int(i) for i in np.unravel_index(cells.argmax(), cells.shape))
        rows = np.arange(max(row - 1, 0), min(row + 2, cells.shape[0]))
        cols = np.arange(max(col - 1, 0), min(col + 2, cells.shape[1]))
        near = cells[np.ix_(rows, cols)]
        total = float(near.sum())
        mean_row = float((near.sum(1) * rows).sum()) / total
        mean_col = float((near.sum(0) * cols).sum()) / total
        pixel = (
            min(max(round(2 * mean_row + 0.5), 0), self.workspace.rows - 1),
            min(max(round(2 * mean_col + 0.5), 0), self.workspace.cols - 1),
        )
        radius = CONFIDENCE_RADIUS / (2 * self.workspace.pixel_size)
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


def load_policy(path_or_name: str | Path = "default") -> Policy:
    """A policy from a .safetensors file, a training folder, a shipped name or `default`.

    Raises CheckpointError where the file is missing, damaged or made for another encoder.
    """
    path = resolve_checkpoint(path_or_name)
    tensors, card = load_checkpoint(path)
    if card.encoder != ENCODER_NAME:
        raise CheckpointError(f"checkpoint {path} needs the text encoder {card.encoder!r}; here is {ENCODER_NAME!r}")
    anchors = tensors.pop(ANCHORS, None)
    network = CompactNetwork(card.network)
    try:
        network.load_state_dict(tensors)
    except RuntimeError as error:
        reason = " ".join(str(error).split())[:200]
        raise CheckpointError(
            f"checkpoint {path} does not fit its card ({reason}): restore it or train again"
        ) from error
    if anchors is None:
        raise CheckpointError(f"checkpoint {path} lacks {ANCHORS}: train again")
    return Policy(network, anchors, card, shared_encoder())
