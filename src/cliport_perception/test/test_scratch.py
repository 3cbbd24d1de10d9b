from __future__ import annotations

from threading import Thread

import numpy as np

from cliport_perception.scratch import Scratch


def test_memory_is_used_again_for_arrays_that_are_no_larger() -> None:
    scratch = Scratch()
    large = scratch.array("a", (3, 5, 7), np.float32)
    small = scratch.array("a", (3, 4, 2), np.float32)
    assert small.shape == (3, 4, 2) and small.flags.c_contiguous and np.shares_memory(large, small)
    assert np.shares_memory(large, scratch.array("a", (3, 5, 7), np.float32)), "handed out anew after a small one"
    assert scratch.array("a", (0, 7), np.float32).size == 0


def test_another_name_type_size_or_thread_has_memory_of_its_own() -> None:
    scratch = Scratch()
    first = scratch.array("a", (4, 4), np.float32)
    found: list[np.ndarray] = []
    thread = Thread(target=lambda: found.append(scratch.array("a", (4, 4), np.float32)))
    thread.start()
    thread.join()
    found += [scratch.array("b", (4, 4), np.float32), scratch.array("a", (4, 4), np.int32)]
    larger = scratch.array("a", (5, 4), np.int32)
    assert larger.shape == (5, 4) and larger.dtype == np.int32
    assert not any(np.shares_memory(first, other) for other in (*found, larger))
