import hashlib

import numpy as np
import pytest

from geomotion.config import CoManipulationDataset
from geomotion.demos.readers import comanipulation, read
from geomotion.errors import DatasetError, InvalidSetting, MissingData


def config(root=None, symbol=17, **settings):
    return CoManipulationDataset(name="x", symbol=symbol, root=root and str(root), **settings)


@pytest.fixture(scope="module")
def strokes(comanipulation_folder):
    return read(config(comanipulation_folder))


def test_the_file_is_the_published_one(comanipulation_folder):
    content = (comanipulation_folder / comanipulation.FILE).read_bytes()
    assert hashlib.sha256(content).hexdigest() == comanipulation.SHA256[17]


def test_six_strokes_with_a_corner_on_a_table(strokes):
    assert (len(strokes), strokes.space) == (6, "R3xS3")
    for one in strokes.trajectories:
        position = one.channels["position_m"]
        assert position.shape == (300, 3)
        assert np.ptp(position[:, 2]) < 0.003
        np.testing.assert_allclose(position[-1] - position[0], [0.09, -0.15, 0.0], atol=0.02)
        assert 1 < one.duration_s < 15
    assert any("derived orientation_wxyz" in step for step in strokes.steps)


def test_without_rests_the_hand_always_moves(comanipulation_folder, strokes):
    recorded = read(config(comanipulation_folder, rest_speed_m_per_s=0.0))
    for one, whole in zip(strokes.trajectories, recorded.trajectories, strict=True):
        assert one.duration_s < 0.85 * whole.duration_s
        speed = np.linalg.norm(np.diff(one.channels["position_m"], axis=0), axis=1) / np.diff(one.time_s)
        assert (speed > 0.003).mean() > 0.98


def test_the_hand_points_down_and_turns_at_the_corner_by_a_right_angle(strokes):
    for one in strokes.trajectories:
        w, x, y, z = one.channels["orientation_wxyz"].T
        np.testing.assert_allclose(w**2 + x**2 + y**2 + z**2, 1, atol=1e-12)
        np.testing.assert_allclose(1 - 2 * (x**2 + y**2), -1, atol=1e-12)  # its z axis, upwards
        yaw = np.unwrap(np.arctan2(2 * (x * y + w * z), 1 - 2 * (y**2 + z**2)))
        assert np.degrees(np.mean(yaw[-5:]) - np.median(yaw[:100])) == pytest.approx(90, abs=25)


def test_a_circle_is_faced_along_its_tangent():
    angle = np.linspace(0, 2, 2001)
    w, x, y, z = comanipulation.facing(np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1), 0.01).T
    yaw = np.arctan2(2 * (x * y + w * z), 1 - 2 * (y**2 + z**2))
    np.testing.assert_allclose(np.unwrap(yaw)[10:-10], angle[10:-10] + np.pi / 2, atol=1e-3)


def test_what_is_missing_or_damaged_is_said(comanipulation_folder, tmp_path):
    with pytest.raises(MissingData, match="COMANIPULATION_DATA_DIR"):
        read(config(tmp_path))
    content = (comanipulation_folder / comanipulation.FILE).read_bytes()
    (tmp_path / comanipulation.FILE).write_bytes(content[: len(content) // 2])
    with pytest.raises(DatasetError, match="truncated"):
        read(config(tmp_path))
    with pytest.raises(DatasetError, match=r"lower dataset\.rest_speed_m_per_s"):
        read(config(comanipulation_folder, rest_speed_m_per_s=5.0))
    with pytest.raises(InvalidSetting, match=r"dataset\.root"):
        config(symbol=3)
