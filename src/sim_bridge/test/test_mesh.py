"""Meshes: closed, facing outwards, of the right size; joined, moved, coloured; read from files."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from cliport_core import Pose
from sim_bridge.errors import SimulationError
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects import bowl_shape

SQUARE = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)]
HOLE = [(0.03, 0.02), (0.05, 0.02), (0.05, 0.06), (0.03, 0.06)]
ELL = [(0.0, 0.0), (0.06, 0.0), (0.06, 0.02), (0.02, 0.02), (0.02, 0.08), (0.0, 0.08)]


def volume(mesh: TriangleMesh) -> float:
    a, b, c = (mesh.vertices[mesh.triangles[:, i]].astype(float) for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


@pytest.mark.parametrize(
    ("mesh", "wanted"),
    [
        (TriangleMesh.box((0.1, 0.2, 0.3)), 0.006),
        (bowl_shape().mesh, None),
        (TriangleMesh.extruded(SQUARE, 0.02), 2e-4),
        (TriangleMesh.extruded(SQUARE[::-1], 0.02, [HOLE]), 1.84e-4),
        (TriangleMesh.extruded(ELL, 0.02), 4.8e-5),
        (TriangleMesh.box((0.1, 0.2, 0.3)).transformed(Pose.looking_at((1, 2, 3), (0, 0, 0)), (-1, 1, 2)), 0.012),
    ],
)
def test_meshes_are_closed_and_face_outwards(mesh: TriangleMesh, wanted: float | None) -> None:
    edges: dict[tuple[int, int], int] = {}
    for triangle in mesh.triangles.tolist():
        for i in range(3):
            edge = (triangle[i], triangle[(i + 1) % 3])
            edges[edge] = edges.get(edge, 0) + 1
    assert all(count == 1 and edges.get(edge[::-1]) == 1 for edge, count in edges.items())
    assert volume(mesh) > 0.0
    assert wanted is None or volume(mesh) == pytest.approx(wanted, rel=1e-5)


def test_a_prism_stands_on_its_outline() -> None:
    mesh = TriangleMesh.extruded(ELL, 0.03)
    assert mesh.vertices[:, 2].min() == 0.0 and mesh.vertices[:, 2].max() == pytest.approx(0.03)
    top = mesh.normals[:, 2] > 0.9
    corners = mesh.vertices[mesh.triangles[top]]
    assert (corners[..., 2] > 0.029).all()
    inside_the_notch = (corners[..., :2].mean(axis=1) > 0.0201).all(axis=1)
    assert not inside_the_notch.any()


@pytest.mark.parametrize(
    ("outline", "height", "holes", "message"),
    [
        (SQUARE, 0.0, [], "height above 0, got 0"),
        (SQUARE[:2], 0.1, [], "three or more"),
        ([(0, 0), (1, 1), (1, 0), (0, 1)], 0.1, [], "no area"),
        (SQUARE, 0.1, [np.array(HOLE) + 1.0], "a hole crosses or leaves it"),
    ],
)
def test_impossible_prisms_are_refused(outline: object, height: float, holes: list[object], message: str) -> None:
    with pytest.raises(SimulationError, match=message):
        TriangleMesh.extruded(outline, height, holes)  # type: ignore[arg-type]


def test_joining_keeps_shape_colours_and_texture() -> None:
    box = TriangleMesh.box((0.1, 0.1, 0.1))
    image = np.zeros((2, 2, 3), dtype=np.uint8)
    textured = TriangleMesh(
        box.vertices, box.triangles, uv=np.zeros((12, 3, 2), dtype=np.float32), texture=image
    ).transformed(scale=2.0)
    both = TriangleMesh.joined([box.colored((1, 2, 3)), textured])
    assert volume(both) == pytest.approx(volume(box) * 9.0, rel=1e-5)
    assert both.colors is not None and both.uv is not None and both.texture is image
    assert both.colors[:12].tolist() == [[1, 2, 3]] * 12
    assert np.isnan(both.uv[:12]).all() and not np.isnan(both.uv[12:]).any()
    assert TriangleMesh.joined([box, box]).colors is None
    with pytest.raises(SimulationError, match=r"colored\(\)"):
        TriangleMesh.joined([box, box.colored((1, 2, 3))])


def test_arrays_that_do_not_fit_are_refused() -> None:
    box = TriangleMesh.box((0.1, 0.1, 0.1))
    with pytest.raises(SimulationError, match=r"need colors \(12, 3\), got \(8, 3\)"):
        TriangleMesh(box.vertices, box.triangles, np.zeros((8, 3), dtype=np.uint8))
    with pytest.raises(SimulationError, match="uv and texture"):
        TriangleMesh(box.vertices, box.triangles, uv=np.zeros((12, 3, 2), dtype=np.float32))


QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def write_texture(path: Path) -> None:
    cv2.imwrite(str(path), np.full((4, 4, 3), (30, 20, 10), dtype=np.uint8))  # BGR


@pytest.mark.parametrize("named", [True, False])
def test_an_obj_file_brings_its_texture(tmp_path: Path, named: bool) -> None:
    path = tmp_path / "thing.obj"
    path.write_text("mtllib thing.mtl\n" * named + QUAD + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3/1 4/4\n")
    if named:
        (tmp_path / "thing.mtl").write_text("newmtl skin\nKd 1 1 1\nmap_Kd the skin.png\n")
    write_texture(tmp_path / ("the skin.png" if named else "thing.png"))
    mesh = TriangleMesh.from_obj(path)
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.uv is not None and mesh.uv.tolist() == [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]]
    assert mesh.texture is not None and mesh.texture[0, 0].tolist() == [10, 20, 30]


def test_an_obj_file_without_a_texture_has_none(tmp_path: Path) -> None:
    path = tmp_path / "thing.obj"
    path.write_text(QUAD + "f 1//1 2//1 3//1\nf -4 -2 -1\n")
    mesh = TriangleMesh.from_obj(path)
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]] and mesh.texture is None


def test_a_ply_file_keeps_its_colours(tmp_path: Path) -> None:
    header = "ply\nformat ascii 1.0\nelement vertex 3\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz")
    header += "".join(f"property uchar {channel}\n" for channel in ("red", "green", "blue"))
    header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    path = tmp_path / "thing.ply"
    path.write_text(header + "0 0 0 30 0 0\n1 0 0 60 0 0\n0 1 0 90 9 0\n3 0 1 2\n")
    mesh = TriangleMesh.from_ply(path)
    assert mesh.vertices.shape == (3, 3) and mesh.triangles.tolist() == [[0, 1, 2]]
    assert mesh.colors is not None and mesh.colors.tolist() == [[60, 3, 0]]


@pytest.mark.parametrize("content", [None, "v 0 0 zero\n", "v 0 0 0\n", QUAD + "f 1 2 9\n"])
def test_files_that_are_no_meshes_are_refused_in_one_line(tmp_path: Path, content: str | None) -> None:
    path = tmp_path / "thing.obj"
    if content is not None:
        path.write_text(content)
        path.with_suffix(".ply").write_text(content)
    with pytest.raises(SimulationError, match=r"thing\.obj"):
        TriangleMesh.from_obj(path)
    with pytest.raises(SimulationError, match=r"thing\.ply"):
        TriangleMesh.from_ply(path.with_suffix(".ply"))
