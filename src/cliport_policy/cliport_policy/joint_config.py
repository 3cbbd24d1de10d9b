"""Configuration of the joint network: one encoder for picks and places, and what else it is made of."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

from cliport_policy.errors import ConfigError
from cliport_policy.settings import TOKEN_DIM, channel_counts, check_choice, check_common_shape, check_keys, check_types

CONTEXT_HEADS = 4  # of the attention among cells
COLOR_WORDS = ("none", "strict", "open")
COLOR_READING = ("tokens", "names")
# what a trained network may change on its way
REREAD = frozenset(
    {
        *("color_reading", "compares_colors", "gray_share"),
        *("reads_sides", "reads_shapes", "reads_kinds", "fits_prints", "sweeps_things"),
    }
)


@dataclass(frozen=True)
class JointConfig:
    """Shape of the joint network; each switch is an ablation.

    widths: channels of the encoder at 1/2, 1/4, 1/8 and 1/16 of the heightmap; decoder_width: of the decoders at 1/2.
    token_dim: width of the frozen text encoder's token embeddings. goal_dim: width of one goal vector.
    context_layers: layers of attention among the cells at 1/16 and to the sentence's tokens; 0 leaves them out.
    transport_channels: features that are correlated. query_cells: side of the query window in cells of 2 pixels.
    gate: True lets a cell have no say in the correlation. crop_pixels: side of the rotator's crop.
    n_rotations: k of rotator and transport.
    color_words: colour densities that are read from the sentence's words, as maps of where such a colour is seen:
    `open` knows all names of the survey, `strict` none that holds a word of the benchmark's unseen colours.
    color_reading: `tokens` lets the maps show how well a pixel's colour suits a token, and everything else read all
    words; `names` lets them show where no basic colour term names it better than the sentence's names do, and
    everything else read the same word for every name.
    compares_colors: True shows, with `names`, a name's colour less where a thing in the scene bears the name far
    better; otherwise maps are those of checkpoints whose cards do not say.
    gray_share: share of training samples in which encoder and decoders see grey, and colours through these maps only.
    null_actions: 1 for "done", 2 for "done" and "not here" apart.
    chooses_primitive: True predicts the primitive; otherwise it is that of the demonstrations.
    reads_sides: True takes, of places that are alike, the one at the side that the sentence names ("the left hole"), by
    a rule; otherwise a word for a side is one like all others. It changes nothing in training.
    reads_shapes: True leads picks to things that have the outline of a letter, a digit or a figure which the sentence
    names, where a presence network tells what is to be picked; in the arm `open` alone, for what they mean is told
    from outside. It changes nothing in training.
    reads_kinds: True leads picks to things of the kind that the sentence names without a colour, where a presence
    network knows it, and hears from it what lies in its box already; under a name that it does not know to things that
    look like the kinds whose names mean something near it. It changes nothing in training.
    fits_prints: True looks, where the likeliest places are flat, for a patch of one colour that has the outline of what
    is picked, and has it put down there, turned as the patch lies, instead of asking the aligner; by a rule. It changes
    nothing in training.
    sweeps_things: True begins a sweep on whose way nothing stands at the next likely place from where something does,
    by a rule. It changes nothing in training.
    aligner: True scores the likeliest places and the rotations there on crops around both; otherwise the correlation
    decides alone, as in checkpoints whose cards do not say.
    """

    widths: tuple[int, ...] = (16, 48, 96, 128)
    decoder_width: int = 16
    token_dim: int = TOKEN_DIM
    goal_dim: int = 128
    context_layers: int = 2
    transport_channels: int = 8
    query_cells: int = 31
    gate: bool = True
    crop_pixels: int = 64
    n_rotations: int = 36
    color_words: str = "open"
    color_reading: str = "tokens"
    compares_colors: bool = False
    gray_share: float = 0.4
    null_actions: int = 2
    chooses_primitive: bool = True
    reads_sides: bool = False
    reads_shapes: bool = False
    reads_kinds: bool = False
    fits_prints: bool = False
    sweeps_things: bool = False
    aligner: bool = False

    def __post_init__(self) -> None:
        check_types(self, "network")
        check_choice(self.color_words, COLOR_WORDS, "color_words")
        check_choice(self.color_reading, COLOR_READING, "color_reading")
        if self.color_words == "none" and self.color_reading == "names":
            raise ConfigError("color_reading=names needs color_words strict or open, not none")
        channel_counts(self.widths)
        check_common_shape(self)
        if self.decoder_width < 1:
            raise ConfigError(f"decoder_width={self.decoder_width} must be positive")
        if self.context_layers and self.widths[-1] % CONTEXT_HEADS:
            raise ConfigError(
                f"the last of widths={list(self.widths)} must be a multiple of {CONTEXT_HEADS}, the heads of the "
                "context's attention; or set context_layers to 0"
            )
        if self.null_actions not in (1, 2) or self.context_layers < 0 or not 0 <= self.gray_share <= 1:
            raise ConfigError(
                f"null_actions={self.null_actions} must be 1 or 2, context_layers={self.context_layers} 0 or more, "
                f"gray_share={self.gray_share} in 0..1"
            )

    @property
    def knows_shapes(self) -> bool:
        """True if it is told what named shapes look like."""
        return self.reads_shapes and self.color_words == "open"

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, with the kind, ready for JSON."""
        return {"kind": "joint", **asdict(self)}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> JointConfig:
        """Read the values that `to_dict` returned, without the kind.

        Raises:
            ConfigError: if a name or a value can't be.
        """
        check_keys(values, (f.name for f in fields(cls)), "network")
        return cls(**{**values, "widths": channel_counts(values.get("widths", cls.widths))})
