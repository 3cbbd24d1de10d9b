from cliport_core.throttle import MessageThrottle


def test_the_same_complaint_passes_once_a_period() -> None:
    throttle = MessageThrottle(10.0)
    assert throttle.passes("no picture for 1.5 s", 100.0)
    assert not throttle.passes("no picture for -3 s", 109.9)
    assert throttle.passes("no picture for 12 s", 110.0)
    assert not throttle.passes("no picture for 13 s", 119.0)


def test_another_complaint_passes_at_once() -> None:
    throttle = MessageThrottle(10.0)
    assert throttle.passes("no picture", 0.0)
    assert throttle.passes("no depth", 0.1)
    assert throttle.passes("no picture", 0.2)


def test_after_a_reset_it_passes_again() -> None:
    throttle = MessageThrottle(10.0)
    assert not throttle.reset()
    assert throttle.passes("no picture", 0.0)
    assert throttle.reset() and not throttle.reset()
    assert throttle.passes("no picture", 0.1)
