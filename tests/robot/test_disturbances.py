"""Pushes, noise and latency."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geomotion.robot import panda
from geomotion.robot.disturbances import Measured, Push, Sensors

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def at(x: float) -> Measured:
    return Measured(np.array([x, 0.0, 0.0]), UPRIGHT, panda.HOME_RAD)


@pytest.mark.parametrize(("profile", "impulse"), [("constant", 5.0), ("half_sine", 10 / np.pi)])
def test_a_push_acts_while_it_lasts_and_gives_its_impulse(profile, impulse):
    push = Push(1.0, 0.25, np.array([0.0, 20.0, 0.0]), profile)
    times_s = np.arange(0, 2, 1e-3)
    forces = np.array([push.force_at(time_s)[1] for time_s in times_s])
    assert forces.sum() * 1e-3 == pytest.approx(impulse, rel=0.02)
    assert not forces[(times_s < 1 - 1e-9) | (times_s >= 1.25 + 1e-9)].any()
    assert forces.max() == pytest.approx(20.0, rel=1e-3)


def test_what_is_measured_arrives_periods_later():
    sensors = Sensors(late_periods=2)
    assert [sensors.read(at(x)).position_m[0] for x in range(5)] == [0, 0, 0, 1, 2]
    assert Sensors().read(at(3.0)).position_m[0] == 3.0


def test_noise_has_the_given_deviations_and_repeats_with_its_seed():
    sensors = Sensors(0.002, 0.01, seed=1)
    read = [sensors.read(at(0.0)) for _ in range(1000)]
    turns = Rotation.from_quat([one.orientation_wxyz for one in read], scalar_first=True).as_rotvec()
    np.testing.assert_allclose(np.std([one.position_m for one in read], axis=0), 0.002, rtol=0.1)
    np.testing.assert_allclose(turns.std(axis=0), 0.01, rtol=0.1)
    np.testing.assert_allclose(np.std([one.joints_rad for one in read], axis=0), 0.01, rtol=0.1)
    np.testing.assert_array_equal(Sensors(0.002, 0.01, seed=1).read(at(0.0)).position_m, read[0].position_m)
