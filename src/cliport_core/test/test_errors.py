from cliport_core.errors import FrameError, PixelOutsideError


def test_errors_carry_their_values() -> None:
    frames = FrameError("camera", "base", ["b", "a"])
    assert (frames.source, frames.target, frames.known) == ("camera", "base", ("a", "b"))
    assert "from 'camera' to 'base'" in str(frames) and "a, b" in str(frames)
    assert "none" in str(FrameError("camera", "base", []))
    outside = PixelOutsideError(0.1, 0.2, "x 0..1")
    assert "0.1" in str(outside) and "0.2" in str(outside) and "x 0..1" in str(outside)
