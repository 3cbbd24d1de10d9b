"""A person at the page in a browser teaches the simulated arm: the whole graph, real physics, bags at the end."""

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("playwright.sync_api", reason="no Chromium's driver (playwright) on this machine")
import page_eyes as eyes
import page_person as teaching
from browser_user import CHROMIUM
from playwright.sync_api import expect
from ros_domain import next_domain
from sim_settings import with_slower_rates

from cliport_core.action import Primitive
from cliport_episodes.data_set import DataSet

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine"),
    pytest.mark.timeout(400),
]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[teaching.Workplace]:
    with teaching.workplace(tmp_path_factory.mktemp("teaching"), next_domain(), speed=1.0) as made:
        yield made


@pytest.fixture
def own_place(tmp_path: Path) -> Iterator[teaching.Workplace]:
    """A graph for one try: who is killed while he reads may leave a mutex of Fast DDS locked that others need."""
    params = str(with_slower_rates(tmp_path, 2.0))
    with teaching.workplace(tmp_path, next_domain(), speed=2.0, params=params) as made:
        yield made


@pytest.fixture
def person(place: teaching.Workplace) -> Iterator[teaching.Person]:
    made = teaching.Person(place.browser, place.app.address)
    yield made
    made.page.context.close()


def unused(place: teaching.Workplace, name: str) -> str:
    """A data set's name that no earlier try of the same test has used."""
    return f"{name}-{len(list(place.sets.glob(f'{name}-*')))}"


@pytest.mark.parametrize("to_the_end", [False, pytest.param(True, marks=pytest.mark.soak)])  # half a minute a step
def test_a_demonstration_survives_a_killed_server(own_place: teaching.Workplace, to_the_end: bool) -> None:
    place, name = own_place, teaching.DATA_SET
    person = teaching.Person(place.browser, place.app.address)
    person.change_data_set(name)
    teaching.lay_out(person, place.client, seed=3000)
    person.say(teaching.SENTENCE)
    person.pick_and_place()
    place.kill_and_restart()
    teaching.go_on(person, name)
    expect(person.page.locator("#steps li")).not_to_have_count(0)
    if to_the_end:
        person.pick_and_place()
    score = place.client.score()
    person.end_episode(success=to_the_end)
    assert not person.faults
    assert score == (1.0 if to_the_end else 0.5)
    folder = place.sets / name
    (outcomes,) = teaching.outcomes(folder)
    assert outcomes.count(teaching.SUCCEEDED) == 1 + to_the_end and outcomes[-1] == teaching.SUCCEEDED
    (episode,) = DataSet.open(folder).episodes()
    assert episode.success is to_the_end and episode.finished and not episode.complaints
    assert DataSet.open(folder).episode(episode.name).final is not None
    person.page.context.close()
    assert place.app.end() == 0


@pytest.mark.soak  # two minutes, most of them the same clicks and the same graph as above
@pytest.mark.parametrize("primitive", ["sweep", "fold"])
def test_sweeps_and_folds_are_taught_too(place: teaching.Workplace, person: teaching.Person, primitive: str) -> None:
    name = unused(place, primitive)
    person.change_data_set(name)
    before, after = teaching.sweep_or_fold(person, place.client, primitive, seed=2)
    assert not person.faults
    folder = place.sets / name
    ((*_, last),) = teaching.outcomes(folder)
    assert last == teaching.SUCCEEDED
    data_set = DataSet.open(folder)
    episode = data_set.episode(data_set.episodes()[0].name)
    step = episode.steps[-1]
    record = step.record
    assert record.result is not None and record.action.primitive is Primitive.from_label(primitive)
    assert record.instruction == teaching.OTHERS[primitive][1] and record.pick_box is not None
    goal = record.place_box
    assert goal is not None and episode.final is not None
    middle = (goal.left + goal.right) / 2, (goal.top + goal.bottom) / 2
    nearest = eyes.distance(step.observation().color, "red", middle)
    assert eyes.distance(episode.final.color, "red", middle) < min(20, nearest)  # blocks, or the rope, are there now
    if primitive == "sweep":
        assert after > before
        assert record.action.pick.yaw == record.action.place.yaw  # the hand stands across its way
