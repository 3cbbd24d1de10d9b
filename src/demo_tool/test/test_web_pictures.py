"""Pictures by long poll, as large as the link allows."""

import gc
import http.client
import socket
import threading
import time
from collections.abc import Iterator
from types import SimpleNamespace

import anyio
import cv2
import numpy as np
import pytest
from made_anew import MadeAnew
from web_workplace import DATA_SET, PATIENCE, Workplace, workplace

from cliport_core.errors import EncodingError
from demo_tool.web.jpeg import LEVELS, START_LEVEL, JpegCache, encode, next_level
from demo_tool.web.pictures import Pictures


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MadeAnew[Workplace]]:
    with MadeAnew(lambda: workplace(tmp_path_factory.mktemp("pictures"))) as made:
        yield made


@pytest.fixture
def place(places: MadeAnew[Workplace], request: pytest.FixtureRequest) -> Workplace:
    return places.of(request)


def get(place: Workplace, path: str) -> tuple[int, http.client.HTTPMessage, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", place.port, timeout=PATIENCE)
    connection.request("GET", path)
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, answer.headers, body


def size_of(file: bytes) -> tuple[int, ...]:
    return cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_COLOR).shape


def test_each_answer_is_the_next_picture(place: Workplace) -> None:
    after, stamps, began_ns = 0, [], time.time_ns()
    for _ in range(3):
        status, headers, file = get(place, f"/picture/color.jpg?after={after}")
        assert status == 200 and headers["Content-Type"] == "image/jpeg"
        assert int(headers["X-Sequence"]) > after
        after = int(headers["X-Sequence"])
        stamps.append(int(headers["X-Stamp-Ns"]))
    assert stamps == sorted(set(stamps))
    assert stamps[-1] > began_ns  # of the camera's clock, which is the system's
    assert size_of(file) == (270, 480, 3)


def test_colours_arrive_as_they_are() -> None:
    red = np.full((40, 40, 3), (200, 30, 30), np.uint8)
    decoded = cv2.imdecode(np.frombuffer(encode(red, LEVELS[-1], 4000), np.uint8), cv2.IMREAD_COLOR)
    assert np.abs(decoded[20, 20].astype(int) - (30, 30, 200)).max() < 6  # BGR


def test_answers_do_not_wait_for_acknowledgements(place: Workplace) -> None:
    """Header and body are two writes: with Nagle's algorithm the body would come 40 ms later."""
    connection = http.client.HTTPConnection("127.0.0.1", place.port, timeout=PATIENCE)
    connection.request("GET", "/static/app.js")
    assert connection.getresponse().read()
    client = connection.sock.getsockname()
    sockets = [each for each in gc.get_objects() if type(each) is socket.socket]  # isinstance trips over dead proxies
    (accepted,) = [each for each in sockets if _peer(each) == client]
    assert accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
    connection.close()


def _peer(each: socket.socket) -> object:
    """The other end's address; None where there is none."""
    try:
        return each.getpeername()
    except OSError:
        return None


def test_a_small_page_gets_small_pictures(place: Workplace) -> None:
    assert size_of(get(place, "/picture/color.jpg?width=200")[2]) == (112, 200, 3)


def test_a_slow_link_gets_less_until_it_suffices(place: Workplace) -> None:
    level, sizes = START_LEVEL, []
    for _ in range(5):
        _, headers, file = get(place, f"/picture/color.jpg?level={level}&took=900")
        level = int(headers["X-Level"])
        sizes.append(len(file))
    assert level == 0 and sizes[-1] < 0.7 * sizes[0]
    assert [next_level(level, 100.0) for level in range(len(LEVELS))] == list(range(len(LEVELS)))
    for _ in range(10):
        level = next_level(level, 5.0)
    assert level == len(LEVELS) - 1


def test_what_does_not_come_is_not_waited_for_for_ever(place: Workplace, monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[float] = []  # [s], none of which passes
    monkeypatch.setattr(place.station, "picture", lambda name, after, timeout: waits.append(timeout))
    assert get(place, "/picture/heightmap.jpg")[0] == 204
    assert 1.0 < sum(waits) < 6.0 and max(waits) <= 0.5  # a page that left gives its thread back soon


def test_a_picture_that_cannot_be_decoded_is_said(place: Workplace) -> None:
    def broken() -> np.ndarray:
        raise EncodingError("colour", "bayer_rggb8", ("rgb8", "bgr8"))

    place.station.on_affordance("place", 5, broken)
    status, _, text = get(place, "/picture/place_affordance.jpg")
    assert status == 503 and b"bayer_rggb8" in text
    status, _, text = get(place, "/picture/none.jpg")
    assert status == 404 and b"color, camera, heightmap, pick_affordance, place_affordance" in text


@pytest.mark.parametrize("query", ["after=-1", "after=x", "width=99999", "level=9", "took=1e9", "after=" + "9" * 40])
def test_odd_questions_are_refused(place: Workplace, query: str) -> None:
    status, _, text = get(place, f"/picture/color.jpg?{query}")
    assert status == 400 and b"whole number" in text


def test_pages_that_leave_give_their_threads_back(place: Workplace) -> None:
    def threads() -> int:
        return sum("AnyIO" in thread.name for thread in threading.enumerate())

    for _ in range(60):
        connection = http.client.HTTPConnection("127.0.0.1", place.port, timeout=PATIENCE)
        connection.request("GET", "/picture/heightmap.jpg")
        connection.close()
    end = time.monotonic() + 30.0
    while (status := get(place, "/picture/color.jpg")[0]) == 503:  # all threads wait for those who left
        assert time.monotonic() < end
    assert status == 200 and threads() < 40


class NoCamera:
    """A station to which no picture comes; counts how often it is asked."""

    def __init__(self) -> None:
        self.asked = 0

    def picture(self, name: str, after: int, timeout: float) -> None:
        self.asked += 1


@pytest.mark.parametrize(("ending", "gone"), [(True, False), (False, True)])
def test_nobody_waits_on_for_a_page_that_is_gone_or_a_server_that_ends(ending: bool, gone: bool) -> None:
    async def is_disconnected() -> bool:
        return gone

    async def ask() -> int:
        pictures = Pictures(station)  # type: ignore[arg-type]
        return (await pictures.live(request)).status_code  # type: ignore[arg-type]

    station, app = NoCamera(), SimpleNamespace(state=SimpleNamespace(ending=ending))
    request = SimpleNamespace(path_params={"name": "color"}, query_params={}, app=app, is_disconnected=is_disconnected)
    assert anyio.run(ask) == 204
    assert station.asked == 1


def test_several_pages_cost_one_encoding() -> None:
    picture = np.zeros((50, 50, 3), np.uint8)
    cache = JpegCache()
    first = cache.file("color", 1, picture, LEVELS[0], 50)
    assert cache.file("color", 1, picture, LEVELS[0], 50) is first
    assert cache.file("color", 2, picture, LEVELS[0], 50) is not first


def test_recorded_steps_are_shown(place: Workplace) -> None:
    place.draw("pick", place.table.box_around(place.table.blocks[0]))
    place.draw("place", place.table.box_at(0.5, -0.05))
    place.station.command("record", {})
    place.wait_for("ready")
    name = place.station.view(None)["episode"]["name"]
    status, _, file = get(place, f"/episode/{DATA_SET}/{name}/0.jpg")
    assert status == 200 and size_of(file) == (270, 480, 3)
    assert get(place, f"/episode/{DATA_SET}/{name}/1.jpg")[0] == 404
    assert get(place, "/statistics.png")[1]["Content-Type"] == "image/png"
