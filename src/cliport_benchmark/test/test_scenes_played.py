"""What the gallery, its films and the arm's hand do, with the world and the camera played."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from cliport_benchmark import arm_hand, film, gallery_cli
from cliport_benchmark.arm_hand import ArmHand
from cliport_benchmark.errors import DataFolderError
from cliport_benchmark.film import Film
from cliport_benchmark.record import RecordConfig
from cliport_benchmark.variation import Variation
from cliport_core import PickPlaceAction, PlanarPose, Primitive
from panda_executor.phase import Phase
from sim_bridge.errors import LayoutError, PhysicsError

TASK, OTHER = "put-blocks-in-bowls-seen-colors", "align-rope"
POSE = PlanarPose(0.4, 0.0, 0.0)


class World:
    """A world of which only the time and the calls are known."""

    def __init__(self, config: object = None) -> None:
        self.config, self.time, self.closed = config, 0.0, 0

    def close(self) -> None:
        self.closed += 1


class Camera:
    """A camera that sees one grey."""

    def __init__(self, width: int, height: int, finer: int = 1) -> None:
        self.size = width, height, finer

    def picture(self, world: object) -> np.ndarray:
        return np.full((self.size[1], self.size[0], 3), 99, np.uint8)


@pytest.fixture
def gallery(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The gallery's world: its scenes, and what its films and episodes were asked."""
    made = SimpleNamespace(worlds=[], scenes=[], films=[], error=None)

    def world() -> World:
        made.worlds.append(World())
        return made.worlds[-1]

    def reset(world: World, name: str, split: str, seed: int) -> SimpleNamespace:
        made.scenes.append((name, split, seed))
        return SimpleNamespace(name=name, instruction=f"do {name}")

    class NoFilm:
        def __init__(self, path: Path, world: World, task: object) -> None:
            made.films.append(path.name)

        def __enter__(self) -> SimpleNamespace:
            return SimpleNamespace(on_tick=None)

        def __exit__(self, *_: object) -> None:
            pass

    def run(*_: object) -> SimpleNamespace:
        if made.error:
            raise made.error
        return SimpleNamespace(score=0.5, steps=3, simulated_s=20.0)

    fakes = {"SimWorld": world, "reset_scene": reset, "StageCamera": Camera, "Film": NoFilm, "run_episode": run}
    fakes |= {"Observer": lambda config: None, "ArmHand": lambda *_: None}
    for name, fake in fakes.items():
        monkeypatch.setattr(gallery_cli, name, fake)
    monkeypatch.setattr(gallery_cli.time, "monotonic", iter([10.0, 17.0] * 9).__next__)
    return made


def test_a_gallery_has_a_sheet_of_three_columns_and_a_video_of_each(gallery, tmp_path: Path, capsys) -> None:
    out, videos = tmp_path / "new" / "sheet.png", tmp_path / "videos"
    names = [TASK, OTHER, "palletizing-boxes", "block-insertion"]
    options = ["--out", str(out), "--tasks", ",".join(names), "--split", "val", "--seed", "4"]
    assert gallery_cli.main(options) == 0
    assert capsys.readouterr().out.splitlines() == [
        *(f"[{i}/4] {name}: do {name}" for i, name in enumerate(names, 1)),
        f"4 scenes on {out}",
    ]
    picture = cv2.imread(str(out))
    assert picture is not None and picture.shape == (2 * (348 + 28 + 36 + 20), 3 * 640, 3)
    assert (picture == 99).all(axis=-1).sum() >= 4 * 620 * 348
    assert gallery.scenes == [(name, "val", 4) for name in names] and gallery.worlds[0].closed == 1
    gallery.scenes.clear()
    assert gallery_cli.main([*options, "--tasks", OTHER, "--videos", str(videos)]) == 0
    line = f"{OTHER}: score 0.50 in 3 steps, 20 s; {videos / OTHER}.mp4 after 7 s"
    assert capsys.readouterr().out.splitlines()[-1] == line and gallery.films == [f"{OTHER}.mp4"]
    gallery.error = PhysicsError("the block flew off")
    assert gallery_cli.main([*options, "--tasks", OTHER, "--videos", str(videos)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"{OTHER}: no video, the block flew off"
    assert all(world.closed == 1 for world in gallery.worlds)


@pytest.mark.parametrize("error", [DataFolderError("no room"), LayoutError("no place")])
def test_a_gallery_that_cannot_be_made_is_one_line(gallery, tmp_path: Path, capsys, monkeypatch, error) -> None:
    def fails(*_: object) -> None:
        raise error

    monkeypatch.setattr(gallery_cli, "_write_sheet", fails)
    assert gallery_cli.main(["--out", str(tmp_path / "s.png"), "--tasks", OTHER]) == 1
    assert capsys.readouterr().err == f"error: {error}\n"


class Writer:
    """A video's file that keeps its frames."""

    opens = True

    def __init__(self) -> None:
        self.frames: list[np.ndarray] = []
        self.settings: tuple[Any, ...] = ()
        self.released = False

    def isOpened(self) -> bool:
        return bool(self.settings)

    def open(self, path: str, codec: int, rate: float, size: tuple[int, int]) -> bool:
        self.settings = (codec, rate, size)
        Path(path).touch()
        return self.opens

    def write(self, frame: np.ndarray) -> None:
        self.frames.append(frame)

    def release(self) -> None:
        self.released = True


@pytest.fixture
def writer(monkeypatch: pytest.MonkeyPatch) -> Writer:
    made = Writer()
    fourcc = cv2.VideoWriter.fourcc
    monkeypatch.setattr(film.cv2, "VideoWriter", type("V", (), {"__new__": lambda _: made, "fourcc": fourcc}))
    monkeypatch.setattr(film, "StageCamera", Camera)
    return made


def test_a_film_has_a_frame_each_tenth_of_a_second_and_stays_at_the_end(writer: Writer, tmp_path: Path) -> None:
    world, task = World(), SimpleNamespace(name="task", instruction="put it there")
    with Film(tmp_path / "a.mp4", world, task) as taken:  # type: ignore[arg-type]
        for _ in range(25):
            taken.on_tick()
            world.time += 0.01
        assert len(writer.frames) == 3 and not writer.released, "at 0, 0.1 and 0.2 s"
    assert len(writer.frames) == 3 + 45 and writer.released, "1.5 s of 30 frames"
    assert writer.settings == (cv2.VideoWriter.fourcc(*"vp09"), 30.0, (500, 510))
    assert {frame.shape for frame in writer.frames} == {(510, 500, 3)}
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]


def test_a_film_that_breaks_off_or_cannot_be_written_leaves_nothing(writer: Writer, tmp_path: Path) -> None:
    task = SimpleNamespace(name="task", instruction="put it there")

    def break_off() -> None:
        with Film(tmp_path / "a.mp4", World(), task) as taken:  # type: ignore[arg-type]
            taken.on_tick()
            raise PhysicsError("it flew off")

    with pytest.raises(PhysicsError):
        break_off()
    assert len(writer.frames) == 1 and writer.released and not list(tmp_path.iterdir())
    writer.settings, writer.opens = (), False
    with pytest.raises(DataFolderError, match="cannot write"), Film(tmp_path / "b.mp4", World(), task) as taken:  # type: ignore[arg-type]
        taken.on_tick()


@pytest.mark.parametrize("off", [0.0, 0.5])
@pytest.mark.parametrize("primitive", list(Primitive))
def test_an_arm_that_ended_elsewhere_lets_go_and_goes_back(monkeypatch, primitive: Primitive, off: float) -> None:
    done: list[Any] = []
    hand = object.__new__(ArmHand)

    def run(goal, cloud, workspace, feedback, should_stop) -> str:
        assert (goal.action.primitive, cloud, workspace, should_stop()) == (primitive, "cloud", "workspace", False)
        feedback(Phase.CARRY, 0.5)
        feedback(Phase.RETREAT, 0.9)
        return "result"

    state = SimpleNamespace(positions=arm_hand.ROBOT.ready + np.array([0, 0, 0, -off, 0, 0, 0]))
    panda = SimpleNamespace(state=lambda: state)
    hand._world = SimpleNamespace(panda=panda, settle=lambda: done.append("settled"))  # type: ignore[assignment]
    hand._observer = SimpleNamespace(cloud=lambda frame: "cloud", workspace="workspace")  # type: ignore[assignment]
    ways = {"open": lambda: done.append("opened"), "go_ready": lambda: done.append("ready")}
    hand._runner = SimpleNamespace(run=run, **ways)  # type: ignore[assignment]
    motion = {"rest": lambda seconds: done.append(f"rests {seconds} s"), "reset": lambda: done.append("reset")}
    hand._motion = SimpleNamespace(**motion)  # type: ignore[assignment]
    monkeypatch.setattr(arm_hand, "come_to_rest", lambda world: done.append("came to rest"))
    monkeypatch.setattr(arm_hand, "sleep_where_still", lambda world: done.append("asleep"))
    assert hand.execute(PickPlaceAction(POSE, POSE, primitive), None) == "result"  # type: ignore[arg-type, comparison-overlap]
    drags = primitive is not Primitive.PICK_PLACE
    back = ["opened", "ready"] if off else []
    assert done == [*(["asleep"] if drags else []), *back, "rests 0.1 s", "came to rest" if drags else "settled"]
    done.clear()
    hand.new_scene(primitive)
    assert done == ["reset", *(["came to rest"] if drags else [])]


def test_each_setting_of_a_recording_has_a_name_of_its_own() -> None:
    usual = Variation.parse("mounting")
    names = [
        RecordConfig("align-rope", "val", 7, 3, sentences, variation=variation).name(index)
        for sentences, variation, index in (
            ((), Variation(), 2),
            ((), usual, 0),
            ((), Variation.parse("mounting", (9.0, 9.0)), 0),
        )
    ]
    assert names[:2] == ["align-rope-val-000009", "align-rope-val-000007-mounting"]
    assert names[2].startswith("align-rope-val-000007-mounting-") and len(names[2]) == len(names[1]) + 9
    asked = RecordConfig(
        TASK, "val", 0, 3, ("put the red blocks in a green bowl", "put the blue blocks in a green bowl")
    )
    assert [asked.sentence(index) for index in (0, 1, 2)] == [*asked.sentences, asked.sentences[0]]
    assert (
        asked.name(0)[:-8] == asked.name(0)[: len(f"{TASK}-val-000000-")] and asked.name(0)[-8:] == asked.name(2)[-8:]
    )
