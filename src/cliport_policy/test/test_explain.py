"""The picture of what a policy thinks: of every kind of network, of a row, a bag and a live topic."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from cliport_core.action import PickPlaceAction
from cliport_core.heightmap import Heightmap
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.explain import main
from cliport_policy.explain_picture import DETAIL, TITLE, render_crop, render_explanation, render_rotations
from cliport_policy.inference import Explanation, Inference
from cliport_policy.overlays import PICK_COLOR, SCALE

pytestmark = pytest.mark.usefixtures("one_thread")
WORKSPACE = WorkspaceSpec(pixel_size=0.0125)  # 64 x 32 pixels
HEIGHT = 2 * TITLE + 2 * (TITLE + 32 * SCALE) + TITLE + DETAIL


def _heightmap() -> Heightmap:
    color = np.full((*WORKSPACE.shape, 3), 60, np.uint8)
    return Heightmap(color, np.zeros(WORKSPACE.shape, np.float32), np.ones(WORKSPACE.shape, bool), WORKSPACE, 1)


@pytest.mark.parametrize("name", ["compact", "transporter", "cliport", "image_goal"])
def test_a_row_of_a_data_set(
    name: str, tiny_checkpoint: Callable[..., Path], make_flat_set: Callable[..., Path], tmp_path: Path
) -> None:
    data, out = make_flat_set(tmp_path / "data", 2, actions=1, pixel_size=0.0125), tmp_path / "out.png"
    arguments = ["--checkpoint", str(tiny_checkpoint(name)), "--data", str(data), "--row", "2", "--out", str(out)]
    assert main(arguments) == 0
    picture = cv2.imread(str(out))
    assert picture is not None and picture.shape == (HEIGHT, 3 * DETAIL, 3)


def test_what_is_missing_is_one_line(
    tiny_checkpoint: Callable[..., Path], make_flat_set: Callable[..., Path], tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    path, data = str(tiny_checkpoint("compact")), make_flat_set(tmp_path / "data", 1, actions=1, pixel_size=0.0125)
    other = make_flat_set(tmp_path / "other", 1)
    (tmp_path / "nobag").mkdir()
    cases = [
        (["--data", str(data), "--row", "7"], "numbered from 0: there is none 7"),
        (["--data", str(data), "--row", "-1"], "there is none -1"),
        (["--data", str(tmp_path)], "no data set at"),
        (["--data", str(other)], "is not the policy's"),
        (["--data", str(data), "--instruction", ""], "the instruction is empty"),
        (["--data", str(data), "--checkpoint", "nowhere"], "no checkpoint at 'nowhere'"),
        (["--data", str(data), "--out", str(tmp_path / "no" / "x.png")], "can't write"),
        (["--bag", str(tmp_path / "nobag")], "can't be read as a bag"),
    ]
    for arguments, message in cases:
        if "--bag" in arguments:
            pytest.importorskip("cliport_interfaces.msg")
        assert main(["--checkpoint", path, *arguments]) == 1, arguments
        line = capsys.readouterr().err
        assert message in line and line.count("\n") == 1 and "Traceback" not in line


def test_the_crop_is_turned_to_the_gripper() -> None:
    """A bar along a yaw of 30 degrees lies along the picture's vertical, in which the gripper closes."""
    shape = WorkspaceSpec().shape
    color = np.zeros((*shape, 3), np.uint8)
    row, col = 160, 80
    end = (round(col + 20 * np.cos(np.pi / 6)), round(row + 20 * np.sin(np.pi / 6)))
    cv2.line(color, (col, row), end, (0, 0, 255), 5)
    heightmap = Heightmap(color, np.zeros(shape, np.float32), np.ones(shape, bool), WorkspaceSpec(), 0)
    crop = render_crop(heightmap, (row, col), np.pi / 6)
    blue = np.argwhere(crop[..., 2] > 150)
    assert crop.shape == (DETAIL, DETAIL, 3)
    assert abs(blue[:, 1].mean() - DETAIL / 2) < 6  # centred across
    assert blue[:, 0].min() < DETAIL / 2 - 90 and blue[:, 0].max() < DETAIL / 2 + 30  # from the pick upwards


def test_the_best_rotation_stands_out_where_it_points() -> None:
    probabilities = np.full(8, 0.05, np.float32)
    probabilities[2] = 0.65  # a quarter turn: to the left
    picture = render_rotations(probabilities, PICK_COLOR)
    marked = np.argwhere((picture == PICK_COLOR).all(-1))
    assert len(marked) and marked[:, 1].max() < DETAIL / 2 and abs(marked[:, 0].mean() - DETAIL / 2) < 4


def test_a_network_without_maps_or_rotator_is_pictured() -> None:
    pose = PlanarPose(0.4, 0.0, 0.0)
    inference = Inference(PickPlaceAction(pose, pose), (10, 10), (20, 20), 0.5, 0.5, 0.1)
    picture = render_explanation(_heightmap(), "pick", Explanation(inference, None, np.full(8, 0.125, np.float32)))
    assert picture.shape == (HEIGHT, 3 * DETAIL, 3)


def test_live_and_bag(
    tiny_checkpoint: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    pytest.importorskip("cliport_interfaces.msg")
    import threading

    import rclpy
    from rclpy.serialization import serialize_message
    from ros_domain import next_domain
    from rosbags.rosbag2 import Writer

    from cliport_core.messages import heightmap_to_msg
    from cliport_core.topics import HEIGHTMAP as TOPIC
    from cliport_interfaces.msg import Heightmap as HeightmapMsg

    checkpoint, out = str(tiny_checkpoint("compact")), tmp_path / "out.png"
    base = ["--checkpoint", checkpoint, "--out", str(out), "--instruction", "put the red blocks in a blue bowl"]
    message = heightmap_to_msg(_heightmap(), "panda_link0")
    with Writer(tmp_path / "bag", version=9) as bag:
        connection = bag.add_connection(TOPIC, "cliport_interfaces/msg/Heightmap", msgdef="", rihs01="unknown")
        bag.write(connection, 1, serialize_message(message))
    assert main([*base, "--bag", str(tmp_path / "bag")]) == 0 and out.is_file()
    assert main([*base, "--bag", str(tmp_path / "bag"), "--row", "1"]) == 1
    assert "holds 1 heightmaps" in capsys.readouterr().err

    monkeypatch.setenv("ROS_DOMAIN_ID", str(next_domain()))
    assert main([*base, "--live", "--timeout", "0.3"]) == 1
    assert "no heightmap on /cliport/heightmap for 0.3 s" in capsys.readouterr().err
    context = rclpy.Context()
    context.init()
    node = rclpy.create_node("camera", context=context)
    publisher = node.create_publisher(HeightmapMsg, TOPIC, 1)
    done = threading.Event()

    def publish() -> None:
        while not done.wait(0.1):
            publisher.publish(message)

    thread = threading.Thread(target=publish)
    thread.start()
    out.unlink()
    try:
        assert main([*base, "--live", "--timeout", "20"]) == 0 and out.is_file()
    finally:
        done.set()
        thread.join()
        node.destroy_node()
        context.try_shutdown()
