"""One page holds the arm, the others watch."""

from pathlib import Path

from page_socket import ask, opened, until
from web_workplace import workplace

from demo_tool.web.arm_holder import GONE_AFTER_S, IDLE_AFTER_S, ArmHolder, Standing
from demo_tool.web.session import OPENED_AGAIN

BOX = [100, 100, 140, 140]


def test_the_first_page_holds_and_keeps_it_over_a_reload() -> None:
    holder = ArmHolder()
    holder.join("first", 0.0)
    holder.join("second", 1.0)
    assert holder.standing("first") is Standing.ME and holder.standing("second") is Standing.OTHER
    holder.leave("first", 2.0)
    assert not holder.take_over("second", 3.0)
    holder.join("first", 4.0)
    assert holder.standing("first") is Standing.ME
    assert not holder.take_over("second", 4.0 + GONE_AFTER_S + 1.0)


def test_a_page_that_is_gone_idle_or_generous_is_followed() -> None:
    for release in ("gone", "idle", "given up"):
        holder = ArmHolder()
        holder.join("first", 0.0)
        holder.join("second", 0.0)
        now = 1.0
        if release == "gone":
            holder.leave("first", 1.0)
            now = 1.1 + GONE_AFTER_S
        elif release == "idle":
            holder.act("first", 1.0)
            assert not holder.may_take_over("second", 0.9 + IDLE_AFTER_S)
            now = 1.1 + IDLE_AFTER_S
        else:
            holder.give_up("first")
        assert holder.take_over("second", now)
        assert holder.standing("first") is Standing.OTHER


def test_a_new_page_does_not_inherit_silently_while_the_holder_may_come_back() -> None:
    holder = ArmHolder()
    holder.join("first", 0.0)
    holder.leave("first", 1.0)
    holder.join("second", 2.0)
    assert holder.standing("second") is Standing.OTHER
    holder.join("third", 2.0 + GONE_AFTER_S)
    assert holder.standing("third") is Standing.ME


def test_who_watches_sees_everything_and_may_only_stop(tmp_path: Path) -> None:
    with workplace(tmp_path) as place, opened(place, "holding-page") as first, opened(place, "watching-page") as second:
        until(second, "holder", "other")
        refusal = ask(second, "pick", box=BOX, rotation=0)
        assert not refusal["ok"] and "take over" in refusal["error"]
        assert not ask(second, "take_over")["ok"]
        assert ask(second, "episodes")["ok"]
        assert ask(second, "stop")["ok"] and place.arm.stopped
        assert not ask(second, "resume")["ok"]
        assert ask(first, "resume")["ok"] and not place.arm.stopped
        assert ask(first, "give_up")["ok"] and ask(second, "take_over")["ok"]
        until(first, "holder", "other")
        assert not ask(first, "clear")["ok"] and ask(second, "clear")["ok"]


def test_nobody_commands_an_arm_that_nobody_holds(tmp_path: Path) -> None:
    with workplace(tmp_path) as place, opened(place, "first-page") as first, opened(place, "second-page") as second:
        until(first, "holder", "me")
        assert ask(first, "give_up")["ok"]
        until(second, "holder", None)
        for page in (first, second):
            refusal = ask(page, "primitive", name="sweep")
            assert not refusal["ok"] and refusal["error"] == "no page holds the arm: take over first"
        assert place.station.view(None)["primitive"] == "pick_place"
        assert ask(second, "take_over")["ok"] and ask(second, "primitive", name="sweep")["ok"]


def test_the_same_page_again_replaces_its_old_connection(tmp_path: Path) -> None:
    with workplace(tmp_path) as place, opened(place, "twice-opened") as old:
        until(old, "holder", "me")
        with opened(place, "twice-opened") as new:
            until(new, "holder", "me")
            assert ask(new, "clear")["ok"]
            for _ in range(50):
                if old.close_code is not None:
                    break
                try:
                    old.recv(timeout=1)
                except Exception:
                    break
            assert old.close_code == OPENED_AGAIN
