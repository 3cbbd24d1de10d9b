"""A trained policy: an observation and an instruction in, a pick and a place out. It knows no data set and no ROS."""

from __future__ import annotations

import math
from collections.abc import Collection
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional as F

from cliport_core import errors as core_errors
from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.heightmap import Heightmap
from cliport_core.instruction import normalized_instruction
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.ablation import leave_out
from cliport_policy.card import Card, resolve_checkpoint
from cliport_policy.checkpoint import ANCHORS, load_checkpoint
from cliport_policy.errors import CheckpointError, InstructionError, ObservationError
from cliport_policy.folded_norms import fold_norms
from cliport_policy.inference import AffordanceMaps, Explanation, Inference
from cliport_policy.language import ENCODER_NAME, TextEncoder, TokenEmbeddings, shared_encoder
from cliport_policy.leading import Leads, led_picks
from cliport_policy.memory import release_unused
from cliport_policy.named_colors import with_colors_alike
from cliport_policy.networks.factory import compile_network, restore_network
from cliport_policy.networks.policy_network import Goal, PolicyNetwork
from cliport_policy.null_odds import absence
from cliport_policy.observation import observation_tensor
from cliport_policy.odds import shifted
from cliport_policy.peaks import CellGrid, Peak, best_rotation, mass_of
from cliport_policy.places import Places
from cliport_policy.presence.presence import Missing, Presence
from cliport_policy.presence.stored import load_presence
from cliport_policy.sides import Side, own_side_named, side_named
from cliport_policy.sweeps import LEAST_SHARE, STARTS, meets_something
from cliport_policy.turns import likeliest_turn

_WARM_UP = "put the red blocks in the green bowl"


class Scores(NamedTuple):
    """A network's logits for one observation, float32, before any temperature.

    picks: (h * w,); nulls: (1 or 2,), of "done" and, where the network tells it apart, of "not here".
    yaws: (k,) or None; places: (k, h, w) for a pick at pick.pixel, an aligner's part with them.
    primitives: (number of primitives,), None where none is chosen.
    missing: what a presence network finds least of what is named; None without one. placed: log odds, by what it finds,
    to be added to those of "done".
    """

    picks: Tensor
    nulls: Tensor
    yaws: Tensor | None
    places: Tensor
    pick: Peak
    primitives: Tensor | None = None
    missing: Missing | None = None
    placed: float = 0.0


class Begun(NamedTuple):
    """Pick, and logits of what follows: (1, k) of the yaws there, None without a rotator; (1, k, h, w) of places."""

    pick: Peak
    yaws: Tensor | None
    places: Tensor


class Policy:
    """Locator, rotator and transport behind one call. Made by load_policy."""

    def __init__(
        self,
        network: PolicyNetwork,
        anchors: Tensor,
        card: Card,
        encoder: TextEncoder,
        presence: Presence | None = None,
    ) -> None:
        self.card, self._presence = card, presence
        self._network = network.eval().to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._anchors = anchors  # (A, 384) unit sentence vectors of training instructions
        self._encoder = encoder
        self._accepted = ""  # the last sentence that was
        self.grid = CellGrid(card.workspace, network.cell_size)
        self._places = Places(self._network, self.grid, getattr(card.network, "fits_prints", False))

    @property
    def workspace(self) -> WorkspaceSpec:
        """The grid that observations must have."""
        return self.card.workspace

    @property
    def needs_goal_image(self) -> bool:
        """True if it acts on an image of the finished scene."""
        return self._network.needs_goal_image

    def check_instruction(self, instruction: str) -> None:
        """Raise InstructionError, in one line, for a text that this policy should not act on."""
        try:
            text = normalized_instruction(instruction)
        except core_errors.InstructionError as error:
            raise InstructionError(str(error)) from None
        if not text:
            raise InstructionError("the instruction is empty: say what to put where")
        if text == self._accepted:
            return
        similarity = self.similarity(text)
        if similarity < self.card.min_similarity:
            shown = text if len(text) <= 60 else text[:57] + "..."
            raise InstructionError(
                f"the instruction '{shown}' is unlike anything this policy was trained on (similarity "
                f"{similarity:.2f} < {self.card.min_similarity:.2f}): say it like 'put the red blocks in a green bowl'"
            )
        self._accepted = text

    def similarity(self, instruction: str) -> float:
        """Return the cosine similarity, in [-1, 1], of an instruction to the nearest of the training's.

        Where colours are read by name, all are alike: a white heart is a heart, and a green song is none of the tasks.
        """
        by_name = getattr(self.card.network, "color_reading", "") == "names"
        words = with_colors_alike(instruction) if by_name else instruction
        return self._similarity(self._encoder.encode_one(words))

    def infer(
        self, observation: Heightmap, instruction: str, with_maps: bool = False, goal: Heightmap | None = None
    ) -> Inference:
        """Return the next action for an instruction, and for an image of the goal where the network reads one.

        Its primitive is what the network chooses, or the one that the policy was trained on. A network without a
        rotator leaves the pick's yaw at 0.
        Raises InstructionError for a text it refuses, and ObservationError for a heightmap of another workspace
        or one that shows nothing or holds NaN.
        """
        return self._decide(self.score(observation, instruction, goal), with_maps).inference

    def explain(self, observation: Heightmap, instruction: str, goal: Heightmap | None = None) -> Explanation:
        """Return what `infer` does, with the distributions that it was chosen from."""
        return self._decide(self.score(observation, instruction, goal), with_maps=True)

    def warm_up(self) -> None:
        """Decide once about an empty table, under a sentence that is not checked: the first call is the slowest."""
        rows, cols = self.workspace.shape
        color, height = np.full((rows, cols, 3), 128, np.uint8), np.zeros((rows, cols), np.float32)
        empty = Heightmap(color, height, np.ones((rows, cols), np.bool_), self.workspace)
        self._decide(self._score(empty, _WARM_UP, empty if self.needs_goal_image else None), with_maps=True)

    def score(self, observation: Heightmap, instruction: str, goal: Heightmap | None = None) -> Scores:
        """Return the network's logits for an observation. Raises the errors of `infer`."""
        self.check_instruction(instruction)
        return self._score(observation, instruction, goal)

    def _score(self, observation: Heightmap, instruction: str, goal: Heightmap | None) -> Scores:
        image = self._tensor(observation)
        look = self._presence.look(image, instruction) if self._presence else None
        scores = self._score_image(image, instruction, self._goal_tensor(goal), look.leads if look else None)
        return scores._replace(missing=look.missing, placed=look.placed) if look else scores

    @torch.inference_mode()
    def _score_image(self, image: Tensor, instruction: str, goal: Tensor | None, leads: Leads | None) -> Scores:
        network = self._network
        aim = network.encode_goal([instruction.strip()], goal)
        reads_sides = getattr(self.card.network, "reads_sides", False)
        side = side_named(instruction) if reads_sides else None
        with torch.autocast("cpu", torch.bfloat16, enabled=network.acts_in_bfloat16):
            scores = self._score_goal(image, aim, side, leads)
        own = own_side_named(instruction) if reads_sides else None
        if own is None:
            return scores
        front, back = (self._score_image(image, words, goal, leads).places for words in (own.front, own.back))
        return scores._replace(places=self._places.at_own_side(own.side, front, back, scores.places))

    def _score_goal(self, image: Tensor, goal: Goal, side: Side | None, leads: Leads | None) -> Scores:
        network = self._network
        aim = network.look(image, goal)
        scores = network.score_picks(image, aim)[0].float()
        picks, nulls = scores[: -network.n_null], scores[-network.n_null :]
        picks = led_picks(picks.reshape(self.grid.shape), leads).flatten()
        primitives = network.score_primitives(image, aim)
        chosen = None if primitives is None else primitives[0].float()
        primitive = self._primitive(chosen)
        pick, yaws, places = self._begin(image, aim, picks, primitive)
        is_placed = primitive is Primitive.PICK_PLACE  # what is swept or folded fits nowhere
        printed = self._places.on_prints(image, pick, yaws, places, side) if is_placed else None
        if printed is not None:
            pick, yaws, places = printed
        elif side is not None:
            places = self._places.at_side(side, places)
        if network.has_aligner and is_placed and printed is None:
            places = self._places.with_fits(image, aim, _as_tensor(pick), yaws, places)
        return Scores(picks, nulls, None if yaws is None else yaws[0].float(), places[0].float(), pick, chosen)

    def _begin(self, image: Tensor, aim: Goal, picks: Tensor, primitive: Primitive) -> Begun:
        """Begin at the likeliest pick; a sweep, by a rule, at the likeliest that meets something, if one does."""
        mass = mass_of(picks).reshape(1, *self.grid.shape)
        sweeps_things = primitive is Primitive.SWEEP and getattr(self.card.network, "sweeps_things", False)
        starts = self.grid.peaks(mass, STARTS if sweeps_things else 1, LEAST_SHARE)
        begun = (Begun(at, *self._network.score_rotations(image, aim, _as_tensor(at))) for at in starts)
        likeliest = next(begun)
        if not sweeps_things:
            return likeliest
        return next((one for one in chain([likeliest], begun) if self._meets_something(image, one)), likeliest)

    def _meets_something(self, image: Tensor, begun: Begun) -> bool:
        end, _ = self._place(begun.places[0].float())
        return meets_something(image, begun.pick.pixel, end.pixel, self.workspace.pixel_size)

    def place_peak(self, scores: Scores) -> Peak:
        """Return the best place at its best rotation."""
        return self._place(scores.places)[0]

    def _place(self, places: Tensor) -> tuple[Peak, float]:
        """Return the best place at its best rotation, of logits (k, h, w), and the turn there [rad]."""
        mass = mass_of(places)
        peak = self.grid.peak(mass[best_rotation(mass)])
        return peak, likeliest_turn(mass[:, peak.near].sum(1))

    def _decide(self, scores: Scores, with_maps: bool) -> Explanation:
        """Choose the action. Temperatures change how sure the policy is, not what it does."""
        pick, (place, turn) = scores.pick, self._place(scores.places)
        pick_mass = mass_of(scores.picks, self.card.temperature("pick")).reshape(self.grid.shape)
        place_mass = mass_of(scores.places, self.card.temperature("place"))
        yaws = None if scores.yaws is None else mass_of(scores.yaws)
        pick_yaw = 0.0 if yaws is None else math.remainder(likeliest_turn(yaws), 2 * math.pi)
        place_yaw = math.remainder(pick_yaw + turn, 2 * math.pi)
        primitive = self._primitive(scores.primitives)
        nulls = mass_of(torch.cat((scores.picks, scores.nulls)))[len(scores.picks) :]
        pick_confidence, place_confidence = pick.confidence(pick_mass), place.confidence(place_mass.sum(0))
        done = shifted(float(nulls[0]), self.card.done_bias.get(primitive.label, 0.0) + scores.placed)
        absent, missing = absence(float(nulls[1]) if len(nulls) > 1 else 0.0, scores.missing, done)
        action = PickPlaceAction(
            pick=self._pose_at(pick.pixel, pick_yaw),
            place=self._pose_at(place.pixel, place_yaw),
            primitive=primitive,
            confidence=min(pick_confidence, place_confidence),
        )
        inference = Inference(
            action,
            pick_pixel=pick.pixel,
            place_pixel=place.pixel,
            pick_confidence=pick_confidence,
            place_confidence=place_confidence,
            done_probability=done,
            maps=self._maps(pick_mass, place_mass.max(0)) if with_maps else None,
            absent_probability=absent,
            missing=missing,
        )
        return Explanation(inference, yaws, place_mass.sum((1, 2)))

    def _primitive(self, scores: Tensor | None) -> Primitive:
        return self.card.primitive if scores is None else Primitive(int(scores.argmax()))

    def _pose_at(self, pixel: tuple[int, int], yaw: float) -> PlanarPose:
        x, y = self.workspace.pixel_to_xy(pixel[0], pixel[1])
        return PlanarPose(x, y, yaw)

    def _similarity(self, embeddings: TokenEmbeddings) -> float:
        return float((self._anchors @ embeddings.sentence_vectors()[0]).max())

    def _check_observation(self, observation: Heightmap) -> None:
        if observation.workspace != self.workspace:
            raise ObservationError(
                f"the observation's workspace {observation.workspace} is not the policy's {self.workspace}: "
                "use the workspace file that the policy was trained with"
            )
        if not np.isfinite(observation.height).all():
            raise ObservationError("the observation's heights are not all numbers: mark what was not seen as not valid")
        if not observation.valid.any():
            raise ObservationError("the observation has no valid cell: is the camera's depth image empty?")

    def _tensor(self, observation: Heightmap) -> Tensor:
        self._check_observation(observation)
        return observation_tensor(observation).to(memory_format=torch.channels_last)

    def _goal_tensor(self, goal: Heightmap | None) -> Tensor | None:
        if goal is None and self._network.needs_goal_image:
            raise ObservationError("this policy acts on an image of the goal: hand the goal's heightmap to infer")
        return None if goal is None else self._tensor(goal)

    def _maps(self, pick: NDArray[np.float32], place: NDArray[np.float32]) -> AffordanceMaps:
        return AffordanceMaps(self._full_size(pick), self._full_size(place))

    def _full_size(self, cells: NDArray[np.float32]) -> NDArray[np.float32]:
        up = F.interpolate(
            torch.from_numpy(cells)[None, None], self.workspace.shape, mode="bilinear", align_corners=False
        )[0, 0].numpy()
        return np.asarray(up / max(float(up.sum()), 1e-12), np.float32)


def _as_tensor(peak: Peak) -> Tensor:
    """Return a peak's pixel as networks take it: (1, 2) float32."""
    return torch.tensor([peak.pixel], dtype=torch.float32)


def load_policy(
    path_or_name: str | Path = "default",
    precision: str = "auto",
    compiled: bool = False,
    left_out: Collection[str] = (),
) -> Policy:
    """Load a policy from a .safetensors file, a training folder, a shipped name or `default`.

    precision: as restore_network takes it. compiled: by torch.compile, which takes half a minute of the first action.
    left_out: parts of the network that it acts without, of ablation.PARTS.
    Raises CheckpointError where the file is missing, damaged or made for another encoder, EncoderError where a
    network's frozen encoders are not at hand, and ConfigError where the network has no such part.
    """
    path = resolve_checkpoint(path_or_name)
    stored, card = load_checkpoint(path)
    release_unused()  # what importing torch left, before more is added to it
    if card.encoder != ENCODER_NAME:
        raise CheckpointError(f"checkpoint {path} needs the text encoder {card.encoder!r}; here is {ENCODER_NAME!r}")
    if ANCHORS not in stored:
        raise CheckpointError(f"checkpoint {path} lacks {ANCHORS}: train again")
    tensors, card = leave_out(left_out, stored, card)
    network = restore_network(card.network, tensors, card.frozen, path, precision)
    fold_norms(network.eval())
    presence = load_presence(tensors, card, shared_encoder(), path)
    if compiled:
        compile_network(network)
    anchors = tensors[ANCHORS].clone()  # a view would keep the file in memory
    policy = Policy(network, anchors, card, shared_encoder(), presence)
    release_unused()
    return policy
