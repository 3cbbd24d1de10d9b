from cliport_core.outcome import ActionResult, Outcome


def test_outcomes_have_labels_and_numbers() -> None:
    assert Outcome.GRASP_MISSED.label == "grasp missed"
    assert {outcome for outcome in Outcome if outcome.is_success} == {Outcome.SUCCEEDED, Outcome.PLANNED}
    assert [Outcome.from_number(number) for number in range(8)] == list(Outcome)
    assert Outcome.from_number(8) is Outcome.from_number(-1) is Outcome.EXECUTION_FAILED


def test_a_result_without_a_grasp() -> None:
    result = ActionResult(Outcome.REJECTED, "no")
    assert (result.grasp_centroid, result.gripper_width) == (None, 0.0)
