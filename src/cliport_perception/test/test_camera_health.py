from __future__ import annotations

from cliport_core.throttle import MessageThrottle
from cliport_perception.camera_health import CameraHealth, HealthLimits, Level

TOPICS = {"color": "/c", "depth": "/d", "camera_info": "/i"}
S = 1_000_000_000


def healthy(now_s: int = 100, period_ns: int = S // 10) -> CameraHealth:
    health = CameraHealth(TOPICS, HealthLimits())
    for stream in TOPICS:
        health.on_message(stream)
    for i in range(5):
        now = now_s * S - (4 - i) * period_ns
        assert health.check_age(now - S // 10, now) is None
        assert health.check_valid_fraction(0.9) is None
        health.on_served()
    return health


def test_silence_names_the_silent_topics() -> None:
    health = CameraHealth(TOPICS, HealthLimits())
    health.on_message("color")
    report = health.report(0, 0, 0)
    assert (report.level, report.message) == (Level.ERROR, "nothing received on /d, /i")


def test_streams_that_never_match_are_reported() -> None:
    health = CameraHealth(TOPICS, HealthLimits())
    for stream in TOPICS:
        health.on_message(stream)
    report = health.report(0, 0, 8)
    assert report.level == Level.ERROR
    assert "never match" in report.message


def test_fresh_data_is_ok_with_figures() -> None:
    report = healthy().report(100 * S, 5, 0)
    assert report.level == Level.OK
    assert report.values == {
        "served": "5",
        "unmatched_images": "0",
        "age_s": "0.100",
        "rate_hz": "10.00",
        "valid_fraction": "0.900",
    }


def test_a_frame_that_only_came_late_is_stale_and_anything_else_an_error() -> None:
    health = healthy()
    late = health.check_age(98 * S, 100 * S)
    assert late is not None
    health.on_fault(late)
    assert health.check_age(100 * S, 100 * S) is None  # in time, but none was due
    report = health.report(100 * S, 5, 0)
    assert (report.level, report.message) == (Level.STALE, late)
    health.on_fault("the camera was moved")
    assert health.report(100 * S, 5, 0).level == Level.ERROR


def test_a_frozen_camera_turns_stale_and_recovers() -> None:
    health = healthy()
    report = health.report(102 * S, 0, 0)
    assert report.level == Level.STALE
    assert report.message == "newest camera frame is 2.1 s old (limit 1.0 s)"
    assert health.check_age(103 * S, 103 * S) is None
    health.on_served()
    assert health.report(103 * S, 1, 0).level == Level.OK


def test_a_camera_of_one_hertz_is_one_steady_warning_between_its_frames_too() -> None:
    health = healthy(period_ns=S)
    for late in (0, S // 2, S, 3 * S // 2):
        report = health.report(100 * S + late, 1, 0)
        assert report.level == Level.WARN
        assert report.message == (
            "the camera is slow, a frame every 1.0 s, which is too old after 1.0 s: what is seen is acted on only just "
            "after a frame; raise the camera's rate, or max_age"
        )
    assert health.report(103 * S, 0, 0).level == Level.STALE, "it fell silent"
    assert healthy(period_ns=7 * S // 10).report(100 * S, 1, 0).level == Level.OK
    health = healthy(period_ns=S)
    reason = health.check_age(160 * S, 101 * S)
    assert reason is not None
    health.on_fault(reason)
    assert health.report(101 * S, 1, 0).message == reason, "what is worse than slow is said first"


def test_an_old_frame_is_refused_on_arrival() -> None:
    reason = healthy().check_age(98 * S, 100 * S)
    assert reason is not None
    assert "2.0 s old" in reason


def test_a_frame_from_the_future_points_at_the_clocks() -> None:
    reason = healthy().check_age(160 * S, 100 * S)
    assert reason is not None
    assert "use_sim_time" in reason


def test_depth_that_shows_nothing_is_refused_and_reported() -> None:
    health = healthy()
    reason = health.check_valid_fraction(0.0)
    assert reason is not None
    assert reason.startswith("depth is valid in 0.0 % of the workspace (at least 50 % needed)")
    health.on_fault(reason)
    report = health.report(100 * S, 5, 0)
    assert (report.level, report.message) == (Level.ERROR, reason)


def test_many_unmatched_images_are_a_warning() -> None:
    assert healthy().report(100 * S, 2, 10).level == Level.WARN


def test_a_clock_reset_does_not_spoil_the_rate() -> None:
    health = healthy()
    for i in range(3):
        assert health.check_age(i * S, i * S) is None
        health.on_served()
    assert health.report(2 * S, 1, 0).values["rate_hz"] == "1.00"


def test_throttle_lets_new_complaints_through_at_once() -> None:
    throttle = MessageThrottle(10.0)
    assert throttle.passes("camera is 1.2 s old", 0.0)
    assert not throttle.passes("camera is 3.4 s old", 2.0)
    assert throttle.passes("depth is empty", 3.0)
    assert throttle.passes("depth is empty", 13.1)
    assert throttle.reset()
    assert not throttle.reset()
    assert throttle.passes("depth is empty", 13.2)
