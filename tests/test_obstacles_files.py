"""Meshes and point clouds from files: formats, placement, and files that cannot be used."""

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch

from geomotion.errors import DatasetError, InvalidSetting, MissingData
from geomotion.obstacles.solids import Sphere
from geomotion.obstacles_files import Placement, load_mesh, load_point_cloud

TURNED = Placement(scale=0.1, rotation_rad=(0.0, 0.0, np.pi / 2), translation_m=(0.5, 0.0, 0.2))
CELLS = 24


def write_sphere(path: Path, without_faces: int = 0) -> Path:
    """A ball of radius 1 around (1, 0, 0)."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    ball.apply_translation([1.0, 0, 0])
    ball.update_faces(np.arange(len(ball.faces)) >= without_faces)
    ball.export(path)
    return path


def points(count: int = 40) -> np.ndarray:
    return np.random.default_rng(0).uniform(-1, 1, size=(count, 3))


def write_ply(path: Path, values: np.ndarray) -> None:
    import trimesh

    trimesh.PointCloud(values).export(path)


WRITERS: dict[str, Callable[[Path, np.ndarray], None]] = {
    ".npy": np.save,
    ".npz": lambda path, values: np.savez(path, points=values, colours=np.zeros(3)),
    ".csv": lambda path, values: np.savetxt(path, values, delimiter=",", header="x,y,z", comments=""),
    ".xyz": np.savetxt,
    ".ply": write_ply,
}


@pytest.mark.parametrize("suffix", [".obj", ".stl", ".ply"])
def test_a_mesh_of_every_format_is_scaled_turned_and_moved_and_its_corners_are_one(suffix, tmp_path, caplog):
    mesh = load_mesh(write_sphere(tmp_path / f"ball{suffix}"), TURNED, cells=CELLS)
    assert mesh.is_watertight and not caplog.records
    ball = Sphere(torch.tensor([0.5, 0.1, 0.2]).double(), 0.1)
    x = ball.reference + torch.from_numpy(0.3 * points(500))
    lost = ball.signed_distance(x) - mesh.signed_distance(x)
    assert lost.min() > -0.002
    assert lost.max() < mesh.error_m
    torch.testing.assert_close(mesh.reference, ball.reference, atol=0.005, rtol=0)


@pytest.mark.parametrize(("missing", "meaning"), [(1, "it has an inside"), (600, "no inside")])
def test_a_mesh_with_holes_loads_with_a_warning_that_counts_and_explains_them(missing, meaning, tmp_path, caplog):
    with caplog.at_level(logging.WARNING, logger="geomotion"):
        mesh = load_mesh(write_sphere(tmp_path / "ball.stl", missing), TURNED, cells=CELLS)
    assert not mesh.is_watertight
    (record,) = caplog.records
    assert meaning in record.message
    assert "edges do not belong to exactly two faces" in record.message
    if missing == 1:
        assert " 3 edges" in record.message


def test_the_duck_is_an_obstacle_with_an_inside(caplog):
    pybullet_data = pytest.importorskip("pybullet_data")
    duck = load_mesh(Path(pybullet_data.getDataPath()) / "duck.obj", Placement(scale=0.1))
    assert not duck.is_shell
    assert 0.03 < duck.inradius < duck.bounding_radius < 0.15
    assert duck.signed_distance(duck.reference[None]) < -0.03


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_cloud_of_every_format_holds_the_points_placed(suffix, tmp_path):
    path = tmp_path / f"cloud{suffix}"
    WRITERS[suffix](path, points())
    cloud = load_point_cloud(path, 0.01, TURNED)
    placed = torch.from_numpy(TURNED.apply(points()))
    torch.testing.assert_close(cloud.signed_distance(placed), torch.full((40,), -0.01).double(), atol=1e-6, rtol=0)
    expected = 0.1 * points()[:, [1, 0, 2]] * np.array([-1, 1, 1]) + np.array([0.5, 0, 0.2])
    np.testing.assert_allclose(placed.numpy(), expected)


def test_columns_after_the_third_and_comments_are_passed_over(tmp_path):
    path = tmp_path / "cloud.xyz"
    path.write_text("# scanned\n\n0 0 1 255 255 0\n0 0 2 255 0 0\n")
    cloud = load_point_cloud(path, 0.1)
    np.testing.assert_allclose(cloud.bounding_radius, 1.1)


@pytest.mark.parametrize("load", [load_mesh, lambda path: load_point_cloud(path, 0.1)])
def test_files_that_are_missing_or_of_another_format_are_named(load, tmp_path):
    with pytest.raises(MissingData, match=r"nothing\.ply"):
        load(tmp_path / "nothing.ply")
    with pytest.raises(InvalidSetting, match=r"\.ply"):
        load(tmp_path / "photo.jpg")


def test_meshes_that_cannot_be_used_are_refused(tmp_path):
    path = tmp_path / "mesh.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    with pytest.raises(DatasetError, match="no faces"):
        load_mesh(path)
    path.write_text("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(DatasetError, match="1 of 3 points"):
        load_mesh(path)
    damaged = tmp_path / "mesh.stl"
    damaged.write_bytes(b"\x00\x01")
    with pytest.raises(DatasetError, match=r"cannot be read as \.stl|no faces"):
        load_mesh(damaged)


def test_clouds_that_cannot_be_used_are_refused(tmp_path):
    path = tmp_path / "cloud.npy"
    for values, reason in ((np.zeros((0, 3)), "no points"), (np.zeros((5, 2)), r"\(5, 2\)")):
        np.save(path, values)
        with pytest.raises(DatasetError, match=reason):
            load_point_cloud(path, 0.1)
    np.save(path, np.where(points() > 0.9, np.nan, points()))
    with pytest.raises(DatasetError, match="of 40 points are NaN"):
        load_point_cloud(path, 0.1)
    path.write_bytes(b"\x93NUMPY broken")
    with pytest.raises(DatasetError, match="truncated"):
        load_point_cloud(path, 0.1)
    np.savez(tmp_path / "two.npz", left=points(), right=points())
    with pytest.raises(DatasetError, match="left, right"):
        load_point_cloud(tmp_path / "two.npz", 0.1)
    text = tmp_path / "cloud.csv"
    for content, reason in (
        ("x,y,z\n", "no points"),
        ("1,2,3\n4,five,6\n", "not three numbers"),
        ("1,2,3\n4,5\n", "row"),
    ):
        text.write_text(content)
        with pytest.raises(DatasetError, match=reason):
            load_point_cloud(text, 0.1)


def test_placements_without_meaning_are_refused():
    for scale in (0.0, -1.0, np.inf):
        with pytest.raises(InvalidSetting, match="scale"):
            Placement(scale=scale)
    with pytest.raises(InvalidSetting, match="finite numbers"):
        Placement(translation_m=(np.nan, 0.0, 0.0))
