from __future__ import annotations

import numpy as np
import pytest

from cliport_core.sync import ApproximateSync

MS = 1_000_000


def make(slop_ms: int = 20, queue: int = 5) -> ApproximateSync[str]:
    return ApproximateSync(("color", "depth"), slop_ms * MS, queue)


def test_equal_stamps_match_in_either_order() -> None:
    sync = make()
    assert sync.add("color", 0, "c0") is None
    assert sync.add("depth", 0, "d0") == {"color": "c0", "depth": "d0"}
    assert sync.add("depth", 100 * MS, "d1") is None
    assert sync.add("color", 100 * MS, "c1") == {"color": "c1", "depth": "d1"}
    assert sync.take_counts() == (2, 0)
    assert sync.take_counts() == (0, 0)


@pytest.mark.parametrize(("offset_ms", "matches"), [(19, True), (20, True), (21, False), (-20, True), (-21, False)])
def test_the_slop_is_the_limit(offset_ms: int, matches: bool) -> None:
    sync = make()
    sync.add("color", 1000 * MS, "c")
    assert (sync.add("depth", (1000 + offset_ms) * MS, "d") is not None) is matches


def test_the_nearest_partner_is_taken_and_older_ones_are_dropped() -> None:
    sync = make(slop_ms=50)
    for i, stamp in enumerate((0, 33, 66)):
        sync.add("color", stamp * MS, f"c{i}")
    assert sync.add("depth", 35 * MS, "d") == {"color": "c1", "depth": "d"}
    assert sync.take_counts() == (1, 1)
    assert sync.add("depth", 66 * MS, "d2") == {"color": "c2", "depth": "d2"}


def test_a_silent_stream_fills_no_more_than_the_queue() -> None:
    sync = make(queue=3)
    for i in range(10):
        assert sync.add("color", i * 100 * MS, f"c{i}") is None
    assert sync.take_counts() == (0, 7)
    assert sync.add("depth", 800 * MS, "d") == {"color": "c8", "depth": "d"}


def test_a_clock_that_jumps_back_starts_afresh() -> None:
    sync = make()
    sync.add("color", 9000 * MS, "old")
    assert sync.add("color", 10 * MS, "c") is None
    assert sync.add("depth", 10 * MS, "d") == {"color": "c", "depth": "d"}


@pytest.mark.parametrize("seed", range(5))
def test_no_item_is_handed_out_twice_and_pairs_are_within_the_slop(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sync: ApproximateSync[tuple[str, int]] = ApproximateSync(("a", "b", "c"), 10 * MS)
    events = [(int(33 * MS * i + rng.normal(0, 3 * MS)), name) for i in range(60) for name in "abc"]
    used: set[tuple[str, int]] = set()
    n = 0
    for stamp, name in sorted(events):
        match = sync.add(name, stamp, (name, stamp))
        if match:
            n += 1
            stamps = [item[1] for item in match.values()]
            assert max(stamps) - min(stamps) <= 10 * MS
            assert not used & set(match.values())
            used |= set(match.values())
    assert n > 30


def test_senseless_settings_are_refused() -> None:
    with pytest.raises(ValueError, match="slop_ns"):
        make(slop_ms=-1)
