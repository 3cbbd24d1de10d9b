"""A person at the page in a browser teaches the simulated arm: the whole graph, real physics, bags at the end."""

from pathlib import Path

import pytest

pytest.importorskip("playwright.sync_api", reason="no Chromium's driver (playwright) on this machine")
import page_person as teaching
from playwright.sync_api import expect
from ros_domain import next_domain

from cliport_episodes.data_set import DataSet

pytestmark = [
    pytest.mark.skipif(teaching.CHROMIUM is None, reason="no Chromium on this machine"),
    pytest.mark.timeout(400),
]


def test_a_demonstration_survives_a_killed_server(tmp_path: Path) -> None:
    domain = next_domain()
    with teaching.workplace(tmp_path, domain, speed=2.0) as (client, app, browser):
        person = teaching.Person(browser, app.address)
        person.open_data_set(teaching.DATA_SET)
        teaching.lay_out(person, client, seed=3000)
        person.say(teaching.SENTENCE)
        person.pick_and_place()
        app = teaching.killed_and_restarted(app, tmp_path, domain)
        teaching.go_on(person)
        expect(person.page.locator("#steps li")).to_have_count(1)
        person.pick_and_place()
        score = client.score()
        person.end_episode(success=True)
        assert not person.faults
        assert app.end() == 0
    assert score == 1.0
    folder = tmp_path / "sets" / teaching.DATA_SET
    assert teaching.outcomes(folder) == [[teaching.SUCCEEDED] * 2]
    (episode,) = DataSet.open(folder).episodes()
    assert episode.success and episode.finished and not episode.complaints
    assert DataSet.open(folder).episode(episode.name).final is not None
