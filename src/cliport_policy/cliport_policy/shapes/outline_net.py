"""Network that tells which named shape an outline is."""

from __future__ import annotations

from pathlib import Path

from safetensors import SafetensorError
from safetensors.torch import save_file
from torch import Tensor, nn

from cliport_policy.blank import blank_modules
from cliport_policy.checkpoint import StoredTensors, halved
from cliport_policy.errors import CheckpointError
from cliport_policy.shapes.names import SHAPES
from cliport_policy.whole_files import whole_file

OUTLINES = Path(__file__).parent / "outlines.safetensors"
_WIDTHS = (16, 32, 64, 96)


class OutlineNet(nn.Module):
    """Small CNN on pictures of silhouettes; its last class is any other thing."""

    def __init__(self) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        inputs = 1
        for width in _WIDTHS:
            layers += [
                nn.Conv2d(inputs, width, 3, padding=1, bias=False),
                nn.BatchNorm2d(width),
                nn.ReLU(inplace=True),
                nn.Conv2d(width, width, 3, stride=2, padding=1, bias=False),
                nn.BatchNorm2d(width),
                nn.ReLU(inplace=True),
            ]
            inputs = width
        self.features = nn.Sequential(*layers, nn.AdaptiveAvgPool2d(2), nn.Flatten())
        self.classes = nn.Linear(4 * inputs, len(SHAPES) + 1)

    def forward(self, pictures: Tensor) -> Tensor:
        """Return logits (B, number of SHAPES + 1) for pictures (B, SIDE, SIDE) in 0..1."""
        out: Tensor = self.classes(self.features(pictures[:, None] - 0.5))
        return out


def save_outline_net(net: OutlineNet, path: Path) -> None:
    """Write a net in half precision; the previous file stays if that fails. Raises CheckpointError."""
    with whole_file(path) as temporary:
        save_file(halved(net.state_dict()), temporary)


def load_outline_net(path: Path = OUTLINES) -> OutlineNet:
    """Return a net that learns nothing more.

    Raises:
        CheckpointError: if its file can't be read.
    """
    try:
        stored = StoredTensors(path)
        with blank_modules():
            net = OutlineNet()
        net.load_state_dict(dict(stored), assign=True)
    except (OSError, RuntimeError, SafetensorError) as error:
        raise CheckpointError(
            f"can't read {path} ({' '.join(str(error).split())[:160]}): run fit_shapes again"
        ) from error
    return net.requires_grad_(False).eval()
