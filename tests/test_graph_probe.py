"""The probe does not take what it did not hear for standing still."""

from collections import deque

import pytest
from graph_probe import GraphProbe


@pytest.fixture
def probe(monkeypatch: pytest.MonkeyPatch) -> GraphProbe:
    """A probe without a graph, which remembers three joint states."""
    monkeypatch.setattr("graph_probe._KEPT", 3)
    made = GraphProbe.__new__(GraphProbe)
    made._history = deque([(1.0, 0.2), (2.0, 0.7), (3.0, 0.1)], maxlen=3)
    return made


def test_the_fastest_is_found(probe: GraphProbe) -> None:
    assert probe.fastest(1.5) == 0.7 and probe.fastest(2.5) == 0.1


def test_silence_is_no_standstill(probe: GraphProbe) -> None:
    with pytest.raises(AssertionError, match="no joint state was heard"):
        probe.fastest(3.5, patience=0.0)


def test_what_is_forgotten_is_no_standstill(probe: GraphProbe) -> None:
    with pytest.raises(AssertionError, match="is forgotten"):
        probe.fastest(0.5)
