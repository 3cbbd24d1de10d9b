from value_types import complaints


def test_dataclasses_are_values() -> None:
    assert complaints("demo_tool", mutable={"_PageState"}) == []
