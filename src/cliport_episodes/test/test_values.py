from value_types import complaints


def test_dataclasses_are_values() -> None:
    assert complaints("cliport_episodes", mutable=set()) == []
