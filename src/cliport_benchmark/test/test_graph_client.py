"""The client of a running graph hears what the policy says, and leaves no thread behind."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

pytest.importorskip("cliport_interfaces.msg")

from ros_domain import next_domain
from sensor_msgs.msg import JointState

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.graph_client import GraphClient
from cliport_interfaces.msg import PolicyStatus


@pytest.fixture
def client() -> Iterator[GraphClient]:
    with GraphClient("listener", next_domain()) as client:
        yield client


def test_each_status_is_told_and_kept_until_the_next_instruction(client: GraphClient) -> None:
    told: list[str] = []
    client.on_status = lambda status: told.append(status.message)
    for message in ("looking", "moving"):
        client._take_status(PolicyStatus(message=message))
    assert told == ["looking", "moving"]
    newest = client.newest_status()
    assert newest is not None
    assert newest.message == "moving"
    assert client.wait_status(lambda status: status.message == "looking", 0.0).message == "looking"
    client.instruct("put it there")
    assert client.newest_status() is None


def test_a_status_that_does_not_come_ends_in_the_last_words(client: GraphClient) -> None:
    client._take_status(PolicyStatus(message="looking"))
    with pytest.raises(BenchmarkError, match="no such status within 0 s; the last status was: looking"):
        client.wait_status(lambda _: False, 0.0)
    with pytest.raises(BenchmarkError, match="the graph ended; the last status was: looking"):
        client.wait_status(lambda _: False, 600.0, lambda: False)


def test_only_the_arms_joints_are_motion_and_only_the_first_counts(client: GraphClient) -> None:
    client.instruct("put it there")
    client._take_joints(JointState(name=["panda_joint1", "panda_finger_joint1"], velocity=[0.001, -1.0]))
    assert client._first_motion is None
    client._take_joints(JointState(name=["panda_joint1", "panda_finger_joint1"], velocity=[-0.5, 0.0]))
    first = client._first_motion
    assert first is not None
    client._take_joints(JointState(name=["panda_joint1"], velocity=[0.5]))
    assert client._first_motion == first
    assert client._last_motion >= first


def test_no_thread_of_a_client_outlives_it() -> None:
    before = set(threading.enumerate())
    with GraphClient("listener", next_domain()):
        assert set(threading.enumerate()) > before
    assert set(threading.enumerate()) <= before
