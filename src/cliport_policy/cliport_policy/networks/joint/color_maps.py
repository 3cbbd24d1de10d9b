"""Maps of where the colours are seen that a sentence names for its pick and for its place."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.networks.joint.color_words import LAB_SCALE, ColorDensity, ColorHead, naming, scaled_lab
from cliport_policy.observation import CHANNELS, scaled_color, unscaled

_MOST_WORDS = 4  # colour words of a sentence that are looked at, the surest ones
_SPREAD = (0.3, 0.15, 0.15)  # of a known colour, scaled CIELAB: light and shadow, white balance
_FARTHEST = -3.0  # log nearness: nothing is taken for a colour from which it lies farther
_NOWHERE = -99.0  # log nearness of what is not seen
_PATCH = 3  # half-resolution pixels along the side of what is large enough to be a thing
SEEN = 0.99  # share of what is seen of a half-resolution pixel of a thing
_THING_HEIGHT = 0.005  # m above the table
_LEAST_NAMED = 0.5  # nothing less is taken to bear a colour's name
_NEAR = 2.0  # nats: a thing that suits a colour by so much less than the best one still bears its name
_BLACK = 16 / LAB_SCALE  # scaled L + 16 is 0 where there is no light
_OTHER_HUE = 0.15  # of CIELAB's a and b by L + 16: sides of a thing differ by 0.1, gray and cyan by 0.3
_NAMED_GREY = 140  # 0..255: what known colours name is shown as bright as the benchmark's blocks


class ColorMaps(nn.Module):
    """Attention to a sentence's colour words, whose frozen densities say where such colours are seen.

    The first map is for the pick, the second for the place, the third for whatever helps: what they attend to is
    learned, what the words mean is not.
    """

    n_maps = 3

    def __init__(self, token_dim: int, word_dim: int, compares: bool = False) -> None:
        """compares: whether a name's colour is shown less where a thing bears the name far better."""
        super().__init__()
        self.compares = compares
        self.head = ColorHead(token_dim).requires_grad_(False)
        self.choose = nn.Linear(word_dim, self.n_maps)

    def forward(
        self,
        x: Tensor,
        tokens: Tensor,
        words: Tensor,
        mask: Tensor,
        basic: Tensor | None = None,
        shades: Tensor | None = None,
    ) -> Tensor:
        """Return maps (B, n_maps, H/2, W/2) in 0..1.

        x: (B, 20, H/2, W/2), the observation's channels with 2 x 2 pixels folded into them.
        tokens: (B, T, token_dim), frozen. words: (B, T, word_dim). mask: (B, T). basic: (N, token_dim), of the basic
        colour terms: then tokens are those of colours' names and 0 elsewhere, and maps show where no basic term names a
        pixel better than they do, instead of how well it suits them. shades: (B, T, 3), with basic, scaled CIELAB of
        words whose colour is known, NaN at others: their maps show what is nearest to it of the things that are seen.
        """
        with torch.autocast(x.device.type, enabled=False):
            density = self.head(tokens.float())
            sure = density.is_color.sigmoid() if basic is None else tokens.any(-1).float()  # (B, T)
            if shades is not None:
                sure = torch.where(is_known(shades), 1.0, sure)
            sure, chosen = (sure * mask).topk(min(_MOST_WORDS, sure.shape[1]), dim=1)
            suits = self._suits(x.float(), density, chosen, basic)  # (B, M, N)
            if shades is not None and is_known(shades).any():
                known = shades.gather(1, chosen[..., None].expand(-1, -1, 3))  # (B, M, 3)
                suits = torch.where(is_known(known)[..., None], nearest_shades(x.float(), known), suits)
            score = self.choose(words.float()).gather(1, chosen[..., None].expand(-1, -1, self.n_maps))
            weight = (score + sure.clamp_min(1e-4).log()[..., None]).softmax(1) * sure[..., None]  # (B, M, n_maps)
            maps = weight.transpose(1, 2) @ suits
        return maps.unflatten(2, x.shape[-2:])

    def _suits(self, x: Tensor, density: ColorDensity, chosen: Tensor, basic: Tensor | None) -> Tensor:
        """Return how well each half-resolution pixel suits the chosen words: (B, M, N) in 0..1."""
        batch = torch.arange(len(x), device=x.device)[:, None]
        picked = ColorDensity(*(value[batch, chosen] for value in density))
        lab, height, valid = unfolded(x)
        if basic is None:
            return picked.membership(lab) * valid.unsqueeze(1)
        near = picked.log_nearness(lab)
        suits = naming(near, self.head(basic[None].float()).log_nearness(lab))
        if self.compares:
            is_thing = (valid > SEEN) & (height > _THING_HEIGHT)
            suits = beside_the_best(suits, near, lab, is_thing, x.shape[-2:])
        return suits * valid.unsqueeze(1)


def beside_the_best(suits: Tensor, near: Tensor, lab: Tensor, is_thing: Tensor, size: tuple[int, int]) -> Tensor:
    """Return how well pixels bear a colour's name, less where a thing in the scene bears it far better: (B, M, N).

    A muted cyan is gray where nothing else is, but not beside gray things, though no other word names it better.
    What bears a name best is a patch, since edges look too good. What has the same hue differs by its light only.

    suits: (B, M, N) in 0..1, what each pixel suits beside other words. near: (B, M, N), nats, how near it comes to the
    word's own colour. lab: (B, N, 3), scaled CIELAB. is_thing: (B, N). size: height and width of N pixels.
    """
    bears = is_thing[:, None] & (suits > _LEAST_NAMED)
    patches = F.avg_pool2d(near.masked_fill(~bears, _NOWHERE).unflatten(2, size), _PATCH, 1).flatten(2)
    best, at = patches.max(2, keepdim=True)
    hue = lab[..., 1:] / (lab[..., :1] + _BLACK)
    hues = F.avg_pool2d(hue.transpose(1, 2).unflatten(2, size), _PATCH, 1).flatten(2).transpose(1, 2)
    other = torch.cdist(hues.gather(1, at.expand(-1, -1, 2)), hue) > _OTHER_HUE  # (B, M, N)
    return suits * (near - best + _NEAR).clamp_max(0.0).exp().where(other, 1.0)


def is_known(shades: Tensor) -> Tensor:
    """Return where a word's colour is known: bool (...) of shades (..., 3)."""
    return ~shades.isnan().any(-1)


def shown_by_maps(x: Tensor, maps: Tensor, chosen: Tensor) -> Tensor:
    """Return folded channels (B, 20, H, W) with the chosen samples (B,) in grey, as bright as blocks where maps are.

    maps: (B, n, H, W) in 0..1.
    """
    gray = without_colors(x, chosen)
    named = maps.amax(1, keepdim=True) * chosen[:, None, None, None]
    shown = torch.lerp(gray[:, :12], gray.new_tensor(scaled_color(_NAMED_GREY)), named.to(x.dtype))
    return torch.cat((shown, gray[:, 12:]), dim=1)


def unfolded(x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return scaled CIELAB (B, N, 3), height in m (B, N), and how much is seen, 0..1 (B, N), of folded channels."""
    folded = x.unflatten(1, (CHANNELS, 4)).mean(2)  # (B, 5, H/2, W/2)
    shown = unscaled(folded).flatten(2)
    return scaled_lab(shown[:, :3].transpose(1, 2)), shown[:, 3], folded[:, 4].flatten(1)


def nearest_shades(x: Tensor, known: Tensor) -> Tensor:
    """Return how near each pixel comes to the thing that is nearest to a colour: (B, M, N) in 0..1.

    known: (B, M, 3) scaled CIELAB. A thing stands out from the table; if the nearest is too far, none is taken for it.
    Light shifts the colours of all things alike, so that which is nearest says more than how near it is.
    """
    lab, height, valid = unfolded(x)
    offset = (lab[:, None] - known[:, :, None]) / lab.new_tensor(_SPREAD)
    near = (-0.5 * offset.square().sum(-1)).nan_to_num(_NOWHERE)  # (B, M, N)
    patches = F.avg_pool2d(near.unflatten(2, x.shape[-2:]), _PATCH, 1, _PATCH // 2, count_include_pad=False).flatten(2)
    is_thing = (valid > SEEN) & (height > _THING_HEIGHT)
    best = patches.where(is_thing[:, None], _NOWHERE).amax(2, keepdim=True).clamp_min(_FARTHEST)
    return (near - best).clamp_max(0.0).exp() * valid[:, None]


def without_colors(x: Tensor, gray: Tensor) -> Tensor:
    """Return folded channels (B, 20, H, W) with the chosen samples (B,) in grey: red, green and blue their mean."""
    color = x[:, :12].unflatten(1, (3, 4))
    mean = color.mean(1, keepdim=True).expand(-1, 3, -1, -1, -1)
    shown = torch.where(gray[:, None, None, None, None], mean, color).flatten(1, 2)
    return torch.cat((shown, x[:, 12:]), dim=1)
