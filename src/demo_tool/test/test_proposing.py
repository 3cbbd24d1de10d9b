"""The policy proposes, a person corrects; the server never gets to move the arm."""

import pytest
from station_fakes import BLOCKS

from cliport_core.action import Primitive
from cliport_core.policy_state import PolicyState, ServerStatus
from cliport_core.pose import PlanarPose


@pytest.fixture
def asked(bench):
    bench.begin()
    return bench


def source(bench) -> str:
    return bench.view["draft"]["source"]


def test_a_proposal_becomes_the_draft_and_the_servers_goal_is_dropped(asked) -> None:
    asked.do("propose")
    proposal = asked.view["policy"]["proposal"]
    assert proposal["pick_rotation"] == 0 and proposal["instruction"] == "put the red block aside"
    assert proposal["confidence"] == 0.83
    assert asked.policy.heard == ["put the red block aside", ""]  # dropped before anything is executed
    asked.do("correct")
    draft = asked.view["draft"]
    assert draft["source"] == "proposed" and draft["pick"]["grasp"] is not None
    top, left, bottom, right = draft["pick"]["box"]
    row, col = proposal["pick_pixel"]
    assert top < row < bottom and left < col < right
    asked.do("execute")
    goal = asked.arm.goals[-1]
    assert (goal.action.pick, goal.action.place) == (asked.policy.pick, asked.policy.place)  # exactly as proposed
    assert asked.steps[0]["source"] == "proposed" and asked.view["policy"]["proposal"] is None


@pytest.mark.parametrize(("drawn", "proposed"), [("pick_place", Primitive.SWEEP), ("sweep", Primitive.PICK_PLACE)])
def test_a_proposal_brings_its_primitive(asked, drawn, proposed) -> None:
    asked.do("primitive", name=drawn)
    asked.policy.primitive = proposed
    asked.do("propose")
    assert asked.view["primitive"] == drawn  # nothing changes before it is taken
    asked.do("correct")
    assert asked.view["primitive"] == proposed.label
    asked.do("execute")
    assert asked.arm.goals[-1].action.primitive is proposed


def test_a_changed_box_takes_its_own_centroid_a_turned_one_keeps_the_position(asked) -> None:
    asked.do("propose")
    asked.do("correct")
    draft = asked.view["draft"]
    asked.do("place", box=draft["place"]["box"], rotation=9)
    assert source(asked) == "corrected"
    asked.do("pick", box=asked.table.box_around(BLOCKS[1]), rotation=0)
    asked.do("execute")
    goal = asked.arm.goals[-1]
    pick, place = goal.action.pick, goal.action.place
    assert pick.x == pytest.approx(BLOCKS[1].x, abs=0.01) and pick.y == pytest.approx(BLOCKS[1].y, abs=0.01)
    assert (place.x, place.y) == (0.50, -0.28) and place.yaw == pytest.approx(1.5708, abs=1e-3)
    assert asked.steps[0]["source"] == "corrected"


def test_drawing_the_same_again_changes_nothing_and_clearing_begins_anew(asked) -> None:
    asked.do("propose")
    asked.do("correct")
    pick = asked.view["draft"]["pick"]
    asked.do("pick", box=pick["box"], rotation=9)
    assert source(asked) == "corrected"
    asked.do("pick", box=pick["box"], rotation=0)
    assert source(asked) == "proposed"
    asked.do("clear")
    asked.draw()
    assert source(asked) == "clicked"


@pytest.mark.parametrize(
    ("waits", "words"), [(False, "would move the arm without asking"), (None, "policy server does not answer")]
)
def test_a_server_that_would_not_wait_is_not_asked(asked, waits, words) -> None:
    asked.policy.waits = waits
    asked.do("propose")
    assert asked.policy.heard == [] and asked.state == "failed" and words in asked.last
    assert "no proposal" in asked.refused("correct")


def test_a_server_that_moves_nevertheless_is_told_to_drop_it(asked) -> None:
    asked.policy.instruct = asked.policy.heard.append
    asked.do("propose")
    asked.station.on_policy_status(ServerStatus(PolicyState.EXECUTING, "step 1", "put the red block aside"))
    assert asked.policy.heard[-1] == "" and "began to move without approval" in asked.last


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (PolicyState.FAILED, "not sure enough"),
        (PolicyState.DONE, "the goal looks reached already"),
        (PolicyState.IDLE, "nothing to do: the instruction is 'stop'"),
    ],
)
def test_no_proposal_says_why(asked, state, words) -> None:
    asked.policy.instruct = asked.policy.heard.append
    asked.do("propose")
    assert asked.state == "proposing"
    asked.station.on_policy_status(ServerStatus(state, "about something else", "another instruction"))
    assert asked.state == "proposing"
    asked.station.on_policy_status(ServerStatus(state, words, "put the red block aside"))
    assert asked.state == "failed" and words in asked.last


def test_silence_ends(asked) -> None:
    asked.policy.ask_require_approval = lambda on_answer: None
    asked.do("propose")
    asked.wait(3.1)
    asked.see()
    assert asked.state == "failed" and asked.last == (
        "no answer came as to whether the policy server waits for approval: is the policy server running?"
    )
    asked.policy.ask_require_approval = lambda on_answer: on_answer(True)
    asked.policy.instruct = asked.policy.heard.append
    asked.do("propose")
    asked.wait(46.0)
    assert "the policy's proposal did not come in time" in asked.last and asked.policy.heard[-1] == ""


def test_poses_of_two_observations_are_not_mixed(asked) -> None:
    asked.policy.instruct = lambda text: None
    asked.do("propose")
    pose = PlanarPose(0.42, -0.12, 0.0)
    asked.station.on_policy_pose("pick", pose, 1)
    asked.station.on_policy_status(ServerStatus(PolicyState.WAITING_FOR_APPROVAL, "", "put the red block aside"))
    asked.station.on_policy_pose("place", pose, 2)
    assert asked.state == "proposing"
    asked.station.on_policy_pose("pick", pose, 2)
    assert asked.view["policy"]["proposal"]["confidence"] is None  # the server did not say


def test_a_proposal_out_of_the_picture(asked) -> None:
    asked.policy.place = PlanarPose(0.45, 5.0, 0.0)
    asked.do("propose")
    assert "is not in the picture" in asked.refused("correct")


def test_stop_ends_a_proposal(asked) -> None:
    asked.policy.instruct = asked.policy.heard.append
    asked.do("propose")
    asked.do("stop")
    assert asked.policy.heard[-1] == "" and asked.state == "stopped"
    asked.station.on_policy_status(ServerStatus(PolicyState.WAITING_FOR_APPROVAL, "", "put the red block aside"))
    assert asked.view["policy"]["proposal"] is None


def test_a_policy_server_that_died_while_it_moved_the_arm_is_not_waited_for(asked) -> None:
    asked.draw()
    asked.station.on_policy_status(ServerStatus(PolicyState.EXECUTING, "carrying", "put the red block aside"))
    assert "the policy server is moving the arm" in asked.refused("execute")
    asked.station.on_policy_gone()
    assert asked.view["policy"]["state"] == "absent" and "gone" in asked.view["policy"]["words"]
    asked.do("execute")
    assert len(asked.arm.goals) == 1


def test_a_proposal_of_a_policy_server_that_goes_is_not_waited_for(asked) -> None:
    asked.policy.instruct = asked.policy.heard.append
    asked.do("propose")
    asked.station.on_policy_gone()
    assert asked.state == "failed" and "the policy server is gone" in asked.last
