"""The video of a step's motion: what players read of it, and what a file from elsewhere may be."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from cliport_core.image_files import decode_color_file, encode_jpeg
from cliport_episodes import motion_video
from cliport_episodes.disk import copy_folder
from cliport_episodes.errors import DiskError, EpisodeError
from cliport_episodes.motion_video import MotionVideo, read_frames, video_path, write_video

SIZE = (160, 90)


def video(count: int = 5, period: float = 0.25) -> MotionVideo:
    """Pictures that become lighter; their JPEG files have odd and even lengths."""
    frames = [encode_jpeg(np.full((SIZE[1], SIZE[0], 3), 20 * n, np.uint8), 60 + n) for n in range(count)]
    return MotionVideo(tuple(frames), period, *SIZE)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return video_path(tmp_path, 123)


def test_frames_come_back_as_they_were(path: Path) -> None:
    odd = MotionVideo((b"abc", b"", b"defg"), 0.2, *SIZE)
    for written in (video(), odd):
        write_video(path, written)
        assert read_frames(path) == (written.frames, written.period)
    assert [file.name for file in path.parent.iterdir()] == ["motion_123.avi"]


def test_opencv_plays_it(path: Path) -> None:
    write_video(path, video(7))
    for backend in (cv2.CAP_OPENCV_MJPEG, cv2.CAP_FFMPEG):
        player = cv2.VideoCapture(str(path), backend)
        assert player.get(cv2.CAP_PROP_FRAME_COUNT) == 7 and player.get(cv2.CAP_PROP_FPS) == pytest.approx(4.0)
        for number in range(7):
            there, picture = player.read()
            assert there and picture.shape == (SIZE[1], SIZE[0], 3) and abs(int(picture[0, 0, 0]) - 20 * number) < 3


def test_opencvs_own_file_is_read(path: Path) -> None:
    writer = cv2.VideoWriter(str(path), cv2.CAP_OPENCV_MJPEG, cv2.VideoWriter_fourcc(*"MJPG"), 5.0, SIZE)
    for number in range(3):
        writer.write(np.full((SIZE[1], SIZE[0], 3), 50 * number, np.uint8))
    writer.release()
    frames, period = read_frames(path)
    assert period == 0.2 and [decode_color_file(frame)[0, 0, 0] // 25 for frame in frames] == [0, 2, 4]


def test_none_is_no_error(path: Path) -> None:
    assert read_frames(path) == ((), 0.0)


def test_what_is_torn_or_something_else_is_refused_in_one_line(path: Path) -> None:
    write_video(path, video())
    whole = path.read_bytes()
    for content in (b"", whole[:20], whole[:1000], whole[:-1], os.urandom(5000), whole[:12] + whole[12:] * 2):
        path.write_bytes(content)
        with pytest.raises(EpisodeError, match=r"motion_123\.avi"):
            read_frames(path)


def test_a_large_one_is_not_read(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_video(path, video())
    monkeypatch.setattr(motion_video, "MOST_BYTES", path.stat().st_size)
    assert len(read_frames(path)[0]) == 5
    monkeypatch.setattr(motion_video, "MOST_BYTES", path.stat().st_size - 1)
    with pytest.raises(EpisodeError, match="larger than"):
        read_frames(path)


def test_a_disk_that_refuses_is_named(path: Path) -> None:
    with pytest.raises(DiskError):
        write_video(path.parent / "gone" / path.name, video())


def test_it_goes_with_the_episode(path: Path, tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    write_video(video_path(tmp_path / "a", 1), video())
    copy_folder(tmp_path / "a", tmp_path / "b")
    assert len(read_frames(video_path(tmp_path / "b", 1))[0]) == 5
