from value_types import complaints


def test_dataclasses_are_values() -> None:
    assert complaints("cliport_policy", mutable={"Span", "Tally", "OfflineRun"}) == []
