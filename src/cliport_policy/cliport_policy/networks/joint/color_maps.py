"""Maps of where the colours are seen that a sentence names for its pick and for its place."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from cliport_policy.networks.joint.color_words import ColorDensity, ColorHead, scaled_lab
from cliport_policy.observation import CHANNELS, unscaled

_MOST_WORDS = 4  # colour words of a sentence that are looked at, the surest ones


class ColorMaps(nn.Module):
    """Attention to a sentence's colour words, whose frozen densities say where such colours are seen.

    The first map is for the pick, the second for the place, the third for whatever helps: what they attend to is
    learned, what the words mean is not.
    """

    n_maps = 3

    def __init__(self, token_dim: int, word_dim: int) -> None:
        super().__init__()
        self.head = ColorHead(token_dim).requires_grad_(False)
        self.choose = nn.Linear(word_dim, self.n_maps)

    def forward(self, x: Tensor, tokens: Tensor, words: Tensor, mask: Tensor, basic: Tensor | None = None) -> Tensor:
        """Return maps (B, n_maps, H/2, W/2) in 0..1.

        x: (B, 20, H/2, W/2), the observation's channels with 2 x 2 pixels folded into them.
        tokens: (B, T, token_dim), frozen. words: (B, T, word_dim). mask: (B, T). basic: (N, token_dim), of the basic
        colour terms: then tokens are those of colours' names and 0 elsewhere, and maps show where no basic term names a
        pixel better than they do, instead of how well it suits them.
        """
        with torch.autocast(x.device.type, enabled=False):
            density = self.head(tokens.float())
            sure = (density.is_color.sigmoid() if basic is None else tokens.any(-1).float()) * mask  # (B, T)
            sure, chosen = sure.topk(min(_MOST_WORDS, sure.shape[1]), dim=1)
            suits = self._suits(x.float(), density, chosen, basic)  # (B, M, N)
            score = self.choose(words.float()).gather(1, chosen[..., None].expand(-1, -1, self.n_maps))
            weight = (score + sure.clamp_min(1e-4).log()[..., None]).softmax(1) * sure[..., None]  # (B, M, n_maps)
            maps = weight.transpose(1, 2) @ suits
        return maps.unflatten(2, x.shape[-2:])

    def _suits(self, x: Tensor, density: ColorDensity, chosen: Tensor, basic: Tensor | None) -> Tensor:
        """Return how well each half-resolution pixel suits the chosen words: (B, M, N) in 0..1."""
        batch = torch.arange(len(x), device=x.device)[:, None]
        picked = ColorDensity(*(value[batch, chosen] for value in density))
        folded = x.unflatten(1, (CHANNELS, 4)).mean(2)  # (B, 5, H/2, W/2)
        color = unscaled(folded)[:, :3].flatten(2).transpose(1, 2)  # (B, N, 3)
        if basic is None:
            suits = picked.membership(scaled_lab(color))
        else:
            suits = picked.naming(scaled_lab(color), self.head(basic[None].float()))
        return suits * folded[:, 4:].flatten(2)


def without_colors(x: Tensor, gray: Tensor) -> Tensor:
    """Return folded channels (B, 20, H, W) with the chosen samples (B,) in grey: red, green and blue their mean."""
    color = x[:, :12].unflatten(1, (3, 4))
    mean = color.mean(1, keepdim=True).expand(-1, 3, -1, -1, -1)
    shown = torch.where(gray[:, None, None, None, None], mean, color).flatten(1, 2)
    return torch.cat((shown, x[:, 12:]), dim=1)
