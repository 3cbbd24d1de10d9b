"""`ros2 bag record` and `play`, with real processes over real DDS."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import resource
import signal
import statistics
import termios
import time
from collections.abc import Iterator

import pytest
import yaml
from rclpy.qos import ReliabilityPolicy
from rclpy.serialization import deserialize_message
from ros2_bags import (
    BEST_EFFORT,
    LATCHED,
    MATCHING_TIME,
    START,
    TIMEOUT,
    BagGraph,
    bag_command,
    end,
    publish,
    read_bag,
    storage_file,
    wait_for,
    write_bag,
)
from ros_domain import next_domain
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header, String

from cliport_interfaces.msg import WorkspaceSpec

ROWS = [
    ("/mode", 0.0, String(data="first")),
    ("/mode", 0.1, String(data="second")),
    *(("/words", 0.02 * k, String(data=f"word {k:02d}")) for k in range(75)),
    ("/mode", 1.2, String(data="third")),
]
ROWS.sort(key=lambda row: row[1])


@pytest.fixture
def graph() -> Iterator[BagGraph]:
    one = BagGraph(next_domain())
    yield one
    one.close()


@pytest.fixture
def bag(tmp_path):
    """A bag of 1.5 s: 50 words a second, and a latched mode."""
    write_bag(tmp_path / "bag", ROWS, latched=["/mode"])
    return tmp_path / "bag"


def listen_to_bag(graph: BagGraph) -> None:
    graph.listen("/words", String)
    graph.listen("/mode", String, LATCHED)


# --- record


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_record_play_record_gives_the_same_bag(graph, tmp_path, storage):
    topics = ["/joint_states", "/workspace", "/tf_words"]
    latched = graph.node.create_publisher(String, "/tf_words", LATCHED)
    latched.publish(String(data="latched"))
    first = graph.start(
        "record", "-o", tmp_path / "first", "-s", storage, "--custom-data", "who=me", "--topics", *topics
    )
    publish(graph, 2.0)
    assert end(first)[0] == 0
    graph.node.destroy_publisher(latched)  # what is played comes from the player alone

    second = graph.start("record", "-o", tmp_path / "second", "-s", storage, "--topics", *topics)
    graph.expected = set(topics)
    player = graph.start("play", tmp_path / "first", "-p")
    assert wait_for(lambda: all(graph.node.count_subscribers(topic) for topic in topics))
    graph.resume()
    player.communicate(timeout=TIMEOUT)
    assert end(second, signal.SIGTERM)[0] == 0

    ours, again = read_bag(tmp_path / "first"), read_bag(tmp_path / "second")
    assert {topic: len(rows) for topic, rows in ours.items()} == {topics[0]: 200, topics[1]: 20, topics[2]: 1}
    later = []
    for topic, rows in ours.items():
        assert [data for _, data in rows] == [data for _, data in again[topic]]
        later += [(b - a) * 1e-6 for (a, _), (b, _) in zip(rows, again[topic])]
    middle = statistics.median(later)
    assert statistics.median(abs(one - middle) for one in later) < 50.0  # ms: a busy machine takes some
    for folder in ("first", "second"):
        described = yaml.safe_load((tmp_path / folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
        offers = {
            each["topic_metadata"]["name"]: each["topic_metadata"]["offered_qos_profiles"][0]
            for each in described["topics_with_message_count"]
        }
        assert described["version"] == 9
        assert described["message_count"] == 221
        assert offers["/joint_states"]["reliability"] == "best_effort"
        assert offers["/tf_words"]["durability"] == "transient_local"


def test_a_bag_can_be_read_without_the_workspace(graph, tmp_path):
    recorder = graph.start("record", "-o", tmp_path / "bag", "-e", "^/(work|joint)")
    publish(graph, 0.5)
    assert end(recorder)[0] == 0
    with AnyReader([tmp_path / "bag"]) as reader:
        kinds = {}
        for connection, _, data in reader.messages():
            kinds[connection.topic] = reader.deserialize(data, connection.msgtype)
    assert kinds["/joint_states"].position[0] == pytest.approx(0.49)
    assert hasattr(kinds["/workspace"], "pixel_size")


@pytest.mark.parametrize("options", [["-s", "mcap"], ["-s", "sqlite3"], ["-d", "1"]])
def test_a_killed_recorder_leaves_what_it_had_flushed(graph, tmp_path, options):
    environment = {**graph.environment, "FASTRTPS_DEFAULT_PROFILES_FILE": ""}  # it leaves its shared memory: little
    recorder = graph.start("record", "-o", tmp_path / "bag", *options, "-e", "/(joint|work)", env=environment)
    publish(graph, 2.6)
    recorder.kill()
    info = bag_command("info", tmp_path / "bag")
    assert info.returncode == 0, info.stderr
    assert len(info.stderr.splitlines()) == 1
    match = re.search(r"/joint_states \| Type: sensor_msgs/msg/JointState \| Count: (\d+)", info.stdout)
    assert match and int(match[1]) > 100


def test_record_splits_files(graph, tmp_path):
    recorder = graph.start("record", "-o", tmp_path / "bag", "-d", "1", "-e", "joint_states")
    graph.node.create_subscription(WorkspaceSpec, "/workspace", lambda _message: None, 1)
    publish(graph, 2.5)
    assert end(recorder)[0] == 0
    assert {"bag_0.mcap", "bag_1.mcap", "bag_2.mcap"} == {path.name for path in (tmp_path / "bag").glob("*.mcap")}
    rows = read_bag(tmp_path / "bag")["/joint_states"]
    assert len(rows) == 250
    assert [stamp for stamp, _ in rows] == sorted(stamp for stamp, _ in rows)
    assert "Messages:          250\n" in bag_command("info", tmp_path / "bag").stdout


def test_record_stamps_with_simulation_time(graph, bag, tmp_path):
    recorder = graph.start("record", "-o", tmp_path / "new", "--use-sim-time", "--topics", "/words")
    graph.expected = {"/clock"}
    player = graph.start("play", bag, "-p", "--clock", "--topics", "/words")
    assert wait_for(lambda: graph.node.count_subscribers("/words") and graph.node.count_subscribers("/clock"))
    graph.resume()
    player.communicate(timeout=TIMEOUT)
    assert end(recorder)[0] == 0
    stamps = [stamp - START for stamp, _ in read_bag(tmp_path / "new")["/words"]]
    assert len(stamps) == 75
    assert stamps[-1] == pytest.approx(1.48e9, abs=0.2e9)


def test_record_ends_on_a_full_disk(graph, tmp_path):
    big = graph.node.create_publisher(String, "/big", 10)
    recorder = graph.record(tmp_path / "bag", topics=["/big"])
    resource.prlimit(recorder.pid, resource.RLIMIT_FSIZE, (1_500_000, 1_500_000))
    assert wait_for(lambda: big.publish(String(data="x" * 100_000)) or recorder.poll() is not None)
    output, _ = recorder.communicate(timeout=TIMEOUT)
    assert recorder.returncode == 1
    assert "Traceback" not in output
    assert output.splitlines()[-1].startswith(f"Cannot write to bag '{tmp_path / 'bag'}': File too large.")
    assert re.search(r"^Messages: +1\d$", bag_command("info", tmp_path / "bag").stdout, re.MULTILINE)


def test_record_leaves_out_types_that_are_not_there(graph, tmp_path):
    environment = {**graph.environment, "AMENT_PREFIX_PATH": "", "PYTHONPATH": ""}
    graph.node.create_publisher(WorkspaceSpec, "/workspace", 1)
    words = graph.node.create_publisher(String, "/words", LATCHED)
    words.publish(String(data="kept"))
    recorder = graph.start("record", "-o", tmp_path / "bag", "-a", env=environment)
    assert wait_for(words.get_subscription_count)
    time.sleep(0.5)
    status, output = end(recorder)
    assert status == 0
    assert "Topic '/workspace' has unknown type 'cliport_interfaces/msg/WorkspaceSpec' and is not recorded" in output
    assert "Traceback" not in output
    assert len(read_bag(tmp_path / "bag")["/words"]) == 1


# --- play


@pytest.mark.parametrize(("storage", "version"), [("mcap", 9), ("sqlite3", 9), ("mcap", 5), ("sqlite3", 5)])
def test_play_gives_jazzys_and_humbles_bags_as_they_are(graph, tmp_path, storage, version):
    written = write_bag(tmp_path / "theirs", ROWS, storage, version, latched=["/mode"])
    listen_to_bag(graph)
    player = graph.play(tmp_path / "theirs", "-r", "3")
    output, _ = player.communicate(timeout=TIMEOUT)
    assert player.returncode == 0, output
    for topic in ("/words", "/mode"):  # the latched one came from a latched publisher, else nothing would be heard
        assert wait_for(lambda topic=topic: graph.data(topic) == [data for name, _, data in written if name == topic])


def test_start_offset_gives_latched_messages_first(graph, bag):
    listen_to_bag(graph)
    graph.play(bag, "--start-offset", "1.0", "--playback-duration", "0.3").communicate(timeout=TIMEOUT)
    assert graph.texts("/mode") == ["first", "second", "third"]
    assert graph.texts("/words") == [f"word {k}" for k in range(50, 65)]
    assert graph.heard["/mode"][1][0] <= graph.heard["/words"][0][0]


def test_play_filters_remaps_overrides_and_loops(graph, bag, tmp_path):
    (tmp_path / "qos.yaml").write_text("/words: {reliability: best_effort, durability: volatile, depth: 5}")
    graph.listen("/said", String, BEST_EFFORT)
    graph.listen("/mode", String)
    graph.expected = {"/said"}
    player = graph.play(
        bag, "--topics", "/words", "-m", "/words:=/said", "-l", "-r", "5", "--qos-profile-overrides-path",
        tmp_path / "qos.yaml",
    )  # fmt: skip
    assert wait_for(lambda: len(graph.data("/said")) > 150)
    (publisher,) = graph.node.get_publishers_info_by_topic("/said")
    assert publisher.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    status, output = end(player)
    assert status == 2
    assert "Traceback" not in output
    assert not graph.data("/mode")


def test_play_publishes_the_bags_time(graph, bag):
    graph.listen("/clock", Clock, BEST_EFFORT)
    graph.play(bag, "--clock", "100", "-r", "0.5").communicate(timeout=TIMEOUT)
    clocks = [deserialize_message(data, Clock).clock for data in graph.data("/clock")]
    times = [clock.sec - START // 10**9 + 1e-9 * clock.nanosec for clock in clocks]
    assert times == sorted(times)
    assert times[0] == 0.0  # it is published while paused as well
    assert 0.0 < times[-1] < 2.0  # the bag's 1.48 s, which take 2.96: on a busy machine the end is heard a little later


def test_play_pauses_by_service(graph, bag):
    listen_to_bag(graph)
    graph.play(bag, "-l")

    def is_playing() -> bool:
        time.sleep(0.1)  # what is on its way
        before = len(graph.data("/words"))
        return wait_for(lambda: len(graph.data("/words")) > before + 5, 0.5)

    assert is_playing()
    for name, playing in [("pause", False), ("resume", True), ("toggle_paused", False), ("toggle_paused", True)]:
        graph.call_player(name)
        assert is_playing() == playing, name


def test_play_pauses_by_the_space_bar(graph, bag):
    listen_to_bag(graph)
    keyboard, terminal = pty.openpty()
    settings = termios.tcgetattr(terminal)
    player = graph.start(
        "play", bag, "-p", stdin=terminal, start_new_session=True,
        preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
    )  # fmt: skip
    assert player.stdout is not None
    while "Press SPACE" not in player.stdout.readline():
        assert player.poll() is None
    assert wait_for(lambda: graph.node.count_publishers("/words") and graph.node.count_publishers("/mode"))
    assert not wait_for(lambda: graph.data("/words"), MATCHING_TIME)
    os.write(keyboard, b"x ")
    output, _ = player.communicate(timeout=TIMEOUT)
    assert player.returncode == 0, output
    assert wait_for(lambda: len(graph.data("/words")) == 75)
    assert termios.tcgetattr(terminal) == settings
    os.close(keyboard)
    os.close(terminal)


def test_play_of_a_torn_bag_with_a_type_that_is_not_there(graph, tmp_path):
    odd = [("/strange", 0.0, Header()), *ROWS]
    write_bag(tmp_path / "torn", odd, types={"/strange": "nowhere_msgs/msg/Thing"}, latched=["/mode"])
    file = storage_file(tmp_path / "torn")
    content = file.read_bytes()
    file.write_bytes(content[: content.index(b"word 40") + 3])
    listen_to_bag(graph)
    player = graph.play(tmp_path / "torn")
    output, _ = player.communicate(timeout=TIMEOUT)
    assert player.returncode == 0
    lines = [line for line in output.splitlines() if line.startswith("WARNING")]
    assert "is not complete" in lines[0] and "Ignoring topic '/strange'" in lines[1] and len(lines) == 2
    assert wait_for(lambda: graph.texts("/words") == [f"word {k:02d}" for k in range(40)])
