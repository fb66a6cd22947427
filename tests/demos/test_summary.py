import json

import numpy as np
import pytest

from geomotion.config import DatasetConfig
from geomotion.demos.summary import summarise, summary_table


def test_lengths_speeds_and_ends_of_a_quarter_circle(circles):
    summary = summarise(circles, DatasetConfig(name="x", train_demos=[0, 1], test_demos=[3]))
    demo = summary["demos"][3]
    assert demo["path_length"] == pytest.approx(0.1 * np.pi / 2, rel=1e-3)
    assert demo["mean_speed"] == pytest.approx(demo["path_length"] / 1.0)
    np.testing.assert_allclose([demo["start"], demo["end"]], [[0.1, 0], [0, 0.1]], atol=1e-15)
    assert summary["unit"] == "m"
    assert [demo["set"] for demo in summary["demos"]] == ["train", "train", "unused", "test"]
    assert summary["total"] == {"demos": 4, "points": 220, "duration_s": 4.0}
    assert json.loads(json.dumps(summary)) == summary


def test_joints_are_measured_in_radians(poses):
    summary = summarise(poses, DatasetConfig(name="x", state_channels=["joints_rad"]))
    assert summary["unit"] == "rad"
    assert "length [rad]" in summary_table(summary)


def test_the_table_has_a_line_for_every_demonstration_and_says_where_it_comes_from(circles):
    lines = summary_table(summarise(circles, DatasetConfig(name="x"))).splitlines()
    assert lines[0] == "test/circles: 4 demonstrations, 220 points, 4.00 s"
    for words in ("a formula", "none", "drawn with a compass", "position_m (2)"):
        assert any(words in line for line in lines)
    assert lines[-5].split()[:3] == ["demo", "set", "points"]
    assert lines[-1].split()[:4] == ["3", "test", "70", "1.000"]
    assert "(0.100, 0.000)  (0.000, 0.100)" in lines[-1]
    assert len({len(line) for line in lines[-5:]}) == 1


def test_negative_zeros_and_empty_columns_are_not_shown(circles):
    import dataclasses

    mirrored = [
        dataclasses.replace(trajectory, label="", channels={"position_m": -1e-6 * trajectory.channels["position_m"]})
        for trajectory in circles.trajectories
    ]
    table = summary_table(
        summarise(dataclasses.replace(circles, trajectories=tuple(mirrored)), DatasetConfig(name="x"))
    )
    assert "-0.000" not in table
    assert "label" not in table
