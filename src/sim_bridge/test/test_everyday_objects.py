"""The everyday objects: the project's own set, folders of Google's, and the convex pieces that they collide as."""

import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

from cliport_core import Pose
from sim_bridge.errors import ObjectFolderError
from sim_bridge.everyday import FOLDER_VARIABLE, describe, google_names, object_set
from sim_bridge.everyday.decomposition import convex_pieces
from sim_bridge.everyday.everyday_object import THINNEST
from sim_bridge.everyday.merging import merged
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.block import WIDEST_PINCH
from sim_bridge.task_mechanics.pinches import pinches_lying

OWN = (*object_set().seen, *object_set().unseen)


@pytest.fixture(autouse=True)
def _own_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)


def box(at: float, size: float = 0.02) -> np.ndarray:
    return np.array([at, 0.0, 0.0]) + TriangleMesh.box((size, size, size)).vertices


def write_obj(path: Path, mesh: TriangleMesh) -> None:
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices]
    lines += ["vt 0.1 0.1", "vt 0.9 0.1", "vt 0.1 0.9"]
    lines += [f"f {a}/1 {b}/2 {c}/3" for a, b, c in mesh.triangles + 1]
    path.write_text("\n".join(lines))


def write_ply(path: Path, mesh: TriangleMesh) -> None:
    header = f"ply\nformat ascii 1.0\nelement vertex {len(mesh.vertices)}\nproperty float x\nproperty float y\n"
    header += (
        f"property float z\nelement face {len(mesh.triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    lines = [f"{x} {y} {z}" for x, y, z in mesh.vertices] + [f"3 {a} {b} {c}" for a, b, c in mesh.triangles]
    path.write_text(header + "\n".join(lines) + "\n")


def folder_of(path: Path, names: list[str]) -> Path:
    path.mkdir()
    for name in names:
        write_ply(path / f"{name.replace(' ', '_')}.ply", TriangleMesh.box((0.2, 0.08, 0.012)))
    return path


def test_the_own_set_has_37_seen_and_19_other_names() -> None:
    source = object_set()
    assert describe() == "own-56"
    assert len(set(source.seen)) == 37 and len(set(source.unseen)) == 19 and not set(source.seen) & set(source.unseen)
    assert all(name == name.lower().strip() and name.replace(" ", "").isalpha() for name in OWN)


@pytest.mark.parametrize("edge", [0.075, 0.16])
def test_every_object_fits_its_cell_and_the_hand(edge: float) -> None:
    for name in OWN:
        shape = object_set().named(name).sized(edge)
        extent = np.ptp(shape.mesh.vertices, axis=0)
        assert extent.max() <= edge + 1e-6 and extent.min() >= THINNEST - 1e-6, name
        assert shape.mesh.colors is not None and len(np.unique(shape.mesh.colors, axis=0)) > 1
        pinches = pinches_lying(shape, np.eye(3))
        assert pinches and pinches[0].width <= WIDEST_PINCH, name


def test_pieces_are_about_the_mesh_and_few() -> None:
    for name in OWN:
        thing = object_set().named(name)
        corners = np.concatenate(thing.pieces)
        assert len(thing.pieces) <= 12, name
        assert np.abs(corners.min(axis=0) - thing.mesh.vertices.min(axis=0)).max() < 0.010, name
        assert np.abs(corners.max(axis=0) - thing.mesh.vertices.max(axis=0)).max() < 0.010, name


def test_pinches_turn_with_the_thing() -> None:
    shape = object_set().named("chocolate bar").sized(0.12)
    here, turned = (
        pinches_lying(shape, np.eye(3))[0],
        pinches_lying(shape, Pose.from_xyz_rpy((0, 0, 0), (0, 0, 0.5)).rotation)[0],
    )
    assert abs(here.yaw - np.pi / 2) < 0.2 and abs(turned.yaw - here.yaw - 0.5) < 0.2
    assert here.width == pytest.approx(0.044, abs=0.006) and np.hypot(here.x, here.y) < 0.025


def test_neighbouring_pieces_become_one() -> None:
    assert len(merged([box(0.0), box(0.019)])) == 1
    assert len(merged([box(0.0), box(0.1)])) == 2


def test_pieces_follow_a_hollow_and_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    corner = TriangleMesh.extruded([(0, 0), (0.1, 0), (0.1, 0.03), (0.03, 0.03), (0.03, 0.1), (0, 0.1)], 0.03)
    pieces = convex_pieces(corner)
    assert len(pieces) > 1
    points = np.concatenate(pieces)
    assert points.min() > -1e-4 and points.max() < 0.1 + 1e-4
    assert not any((piece[:, :2].min(axis=1).max() > 0.05) for piece in pieces)

    def never(*_: object, **__: object) -> None:
        raise AssertionError("the pieces were in the cache")

    monkeypatch.setattr(subprocess, "run", never)
    again = convex_pieces(corner)
    assert all((a == b).all() for a, b in zip(pieces, again, strict=True))


def test_a_failed_decomposition_gives_the_hull(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise OSError("no process")

    monkeypatch.setattr(subprocess, "run", fails)
    assert len(convex_pieces(TriangleMesh.box((0.05, 0.04, 0.03)))) == 1


def test_a_folder_lacking_a_few_is_used(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    names = [n for n in (*google_names.SEEN, *google_names.UNSEEN) if n not in ("black fedora", "red cup")]
    monkeypatch.setenv(FOLDER_VARIABLE, str(folder_of(tmp_path / "ply", names)))
    source = object_set()
    assert describe() == "google PLY folder, 54 of 56, without black fedora, red cup"
    assert "black fedora" not in source.seen and "red cup" not in source.unseen
    tablet = source.named("tablet")
    assert (tablet.mesh.colors == google_names.SEEN["tablet"]).all()
    assert np.ptp(tablet.sized(0.1).mesh.vertices, axis=0) == pytest.approx([0.1, 0.04, THINNEST], abs=1e-4)


def test_the_release_with_textures_is_preferred(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "both", [*google_names.SEEN, *google_names.UNSEEN])
    (folder / "meshes").mkdir()
    (folder / "textures").mkdir()
    write_obj(folder / "meshes" / "tablet.obj", TriangleMesh.box((0.2, 0.08, 0.02)))
    cv2.imwrite(str(folder / "textures" / "tablet.png"), np.full((1024, 1024, 3), (0, 0, 200), dtype=np.uint8))
    monkeypatch.setenv(FOLDER_VARIABLE, str(folder))
    mesh = object_set().named("tablet").mesh
    assert (
        mesh.texture is not None and mesh.texture.shape == (512, 512, 3) and (mesh.texture[0, 0] == (200, 0, 0)).all()
    )


def test_a_folder_that_cannot_be_used_ends_in_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    few = folder_of(tmp_path / "few", list(google_names.SEEN))
    for folder, words in (
        (tmp_path / "gone", "is no folder"),
        (tmp_path / "empty", "holds no object"),
        (few, r"lacks 19 of the 56 objects \([^,]+, [^,]+, [^,]+, \.\.\.\)"),
    ):
        monkeypatch.setenv(FOLDER_VARIABLE, str(folder))
        with pytest.raises(ObjectFolderError, match=words) as caught:
            describe()
        assert str(folder) in str(caught.value) and "unset it" in str(caught.value) and "\n" not in str(caught.value)


def test_a_broken_file_names_itself(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "broken", [*google_names.SEEN, *google_names.UNSEEN])
    (folder / "tablet.ply").write_text("ply\nformat ascii 1.0\nend_header\n")
    monkeypatch.setenv(FOLDER_VARIABLE, str(folder))
    with pytest.raises(ObjectFolderError, match=r"tablet\.ply.*replace the file"):
        object_set().named("tablet")
