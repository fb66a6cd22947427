"""Demonstrations that really grasp and drop, and the pictures that go with them; a dozen seconds of simulated time."""

from dataclasses import replace

import numpy as np
import pytest

from geomotion.config import GraspAndDropDataset, ManipulationSkill
from geomotion.demos import readers
from geomotion.demos.generators.grasp_and_drop_pictures import take
from geomotion.demos.generators.panda_grasp_and_drop import OVER_BIN_M, PLACES_M
from geomotion.demos.snapshots import Snapshots, check_pictures, digest_of_picture
from geomotion.errors import CorruptArtefact, ShapeMismatch

SMALL = GraspAndDropDataset(
    name="panda/grasp_and_drop",
    demos=1,
    points=60,
    snapshots=2,
    snapshots_on_the_way=1,
    snapshots_between=2,
    picture_px=32,
)


@pytest.fixture(scope="module")
def demonstrations():
    return readers.read(SMALL)


@pytest.fixture(scope="module")
def pictures(demonstrations):
    return take(SMALL, ManipulationSkill.grasp, demonstrations)


def test_grasps_come_first_and_end_at_the_object_where_drops_begin(demonstrations):
    assert [one.label for one in demonstrations.trajectories[:3]] == [f"grasp, place {k}" for k in (1, 2, 3)]
    assert [one.condition for one in demonstrations.trajectories[3:]] == [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    for place in range(3):
        grasp, drop = (demonstrations[place + first].channels["position_m"] for first in (0, 3))
        np.testing.assert_allclose(grasp[-1, :2], PLACES_M[place], atol=0.02)
        np.testing.assert_allclose(grasp[-1], drop[0], atol=0.005)
        np.testing.assert_allclose(drop[-1], OVER_BIN_M, atol=0.03)
    assert "generated" in demonstrations.source


def test_each_skill_has_its_own_demonstrations():
    dataset = replace(SMALL, demos=3, held_out=1, skill=ManipulationSkill.drop, train_demos=None, test_demos=None)
    assert dataset.train_demos == [9, 10, 12, 13, 15, 16] and dataset.test_demos == [11, 14, 17]


def test_pictures_come_with_where_the_object_lies(pictures):
    assert pictures.pictures.shape == (11, 32, 32, 3) and pictures.pictures.dtype == np.uint8
    assert pictures.place.tolist() == [0, 1, 2, 0, 1, 2, 0, 1, 2, -1, -1]
    assert pictures.is_on_the_way.tolist() == [False] * 6 + [True] * 3 + [False, True]
    np.testing.assert_allclose(pictures.object_m[:6], np.tile(PLACES_M, (2, 1)), atol=0.02)
    assert len({digest_of_picture(one) for one in pictures.pictures}) == 11


def test_the_same_settings_give_the_same_pictures(pictures, demonstrations):
    of_places = replace(SMALL, snapshots_on_the_way=0, snapshots_between=0)
    again = take(of_places, ManipulationSkill.grasp, demonstrations).pictures
    np.testing.assert_array_equal(again, pictures.pictures[:6])


def test_pictures_survive_a_file(pictures, tmp_path):
    pictures.save(tmp_path / "grasp.npz")
    np.testing.assert_array_equal(Snapshots.load(tmp_path / "grasp.npz").pictures, pictures.pictures)
    (tmp_path / "grasp.npz").write_bytes(b"PK nothing")
    with pytest.raises(CorruptArtefact, match="no snapshots"):
        Snapshots.load(tmp_path / "grasp.npz")


@pytest.mark.parametrize(
    ("pictures", "complaint"),
    [
        (np.zeros((1, 32, 32, 4), np.uint8), "RGB with 8 bits"),
        (np.zeros((1, 32, 32), np.uint8), "RGB with 8 bits"),
        (np.zeros((1, 32, 32, 3), np.float32), "RGB with 8 bits"),
        (np.zeros((1, 24, 32, 3), np.uint8), "32 x 32, as in training, found 32 x 24"),
    ],
)
def test_other_modes_and_sizes_are_refused(pictures, complaint):
    with pytest.raises(ShapeMismatch, match=complaint):
        check_pictures(pictures, 32)
