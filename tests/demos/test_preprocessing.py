import numpy as np
import pytest

from geomotion.config import PreprocessConfig, VelocitySource
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.demos.preprocessing import estimate_velocity, preprocess
from geomotion.errors import InvalidSetting

RECORDED = VelocitySource.recorded


def one(time_s, **channels):
    return Demonstrations("test", (Trajectory(np.asarray(time_s, dtype=float), channels),), "R2")


def test_nothing_asked_for_changes_nothing_but_velocities(circles, same):
    same(preprocess(circles, PreprocessConfig(velocity=RECORDED)), circles)


def test_trimming_restarts_the_clock_and_is_recorded(circles):
    config = PreprocessConfig(trim_start_points=5, trim_end_points=2, velocity=RECORDED)
    result = preprocess(circles, config)
    assert [len(trajectory) for trajectory in result.trajectories] == [33, 43, 53, 63]
    assert result[0].time_s[0] == 0
    np.testing.assert_allclose(result[0].time_s, circles[0].time_s[5:-2] - circles[0].time_s[5])
    np.testing.assert_array_equal(result[0].channels["position_m"], circles[0].channels["position_m"][5:-2])
    np.testing.assert_array_equal(result[0].channels["velocity_m_per_s"], circles[0].channels["velocity_m_per_s"][5:-2])
    assert result.steps == (
        "drawn with a compass",
        "trimmed 5 points at the start and 2 points at the end",
        "shifted the time of every demonstration to start at 0 s",
    )


def test_the_input_is_left_alone(circles, same):
    before = Demonstrations(**{**vars(circles)})
    copies = [trajectory.channels["position_m"].copy() for trajectory in circles.trajectories]
    preprocess(circles, PreprocessConfig(trim_start_points=1, align_end=True, scale=3.0, resample_points=20))
    same(circles, before)
    for trajectory, copy in zip(circles.trajectories, copies, strict=True):
        np.testing.assert_array_equal(trajectory.channels["position_m"], copy)


@pytest.mark.parametrize("setting", [{"trim_start_points": 39}, {"trim_end_points": 60}])
def test_trimming_everything_is_refused(circles, setting):
    with pytest.raises(InvalidSetting, match=f"{next(iter(setting))}=.*two points left.*has 40"):
        preprocess(circles, PreprocessConfig(**setting))


def test_velocity_estimates_converge_quadratically_also_at_both_ends():
    def errors(points):
        time_s = np.linspace(0, 1, points) ** 1.3  # uneven
        found = estimate_velocity(time_s, np.sin(3 * time_s)[:, None])[:, 0]
        error = np.abs(found - 3 * np.cos(3 * time_s))
        return np.array([error[0], error[points // 2], error[-1]])

    rates = np.log2(errors(200) / errors(400))
    assert (rates > 1.5).all(), rates  # the first interval shrinks unevenly, so its rate is below 2


def test_velocity_of_a_straight_line_between_two_points_is_exact():
    result = preprocess(one([0, 2], position_m=np.array([[0.0, 1.0], [4.0, 0.0]])), PreprocessConfig())
    np.testing.assert_allclose(result[0].channels["velocity_m_per_s"], [[2, -0.5], [2, -0.5]])


def test_recorded_velocities_that_are_not_there_are_refused(poses):
    with pytest.raises(InvalidSetting, match=r"velocity=recorded .* estimated, because test/poses records no"):
        preprocess(poses, PreprocessConfig(velocity=RECORDED))


def test_estimated_velocities_belong_to_every_channel_that_has_one(poses):
    result = preprocess(poses, PreprocessConfig())
    time_s = result[0].time_s
    np.testing.assert_allclose(result[0].velocity(["position_m"])[:, 1], 2 * time_s, atol=1e-12)
    np.testing.assert_allclose(result[0].velocity(["joints_rad"])[:, 2], 2 * time_s, atol=1e-12)


def test_resampling_is_even_in_time_and_keeps_cubics_and_ends():
    time_s = np.array([0, 0.1, 0.5, 0.6, 1.4, 2.0])
    cubic = np.stack([time_s**3, 1 - time_s + time_s**2], axis=1)
    result = preprocess(one(time_s, position_m=cubic), PreprocessConfig(resample_points=31))
    new = result[0].time_s
    np.testing.assert_allclose(np.diff(new), 2 / 30)
    np.testing.assert_allclose(
        result[0].channels["position_m"], np.stack([new**3, 1 - new + new**2], axis=1), atol=1e-12
    )
    assert result.steps[0] == "resampled to 31 points, even in time (cubic spline)"


def test_recorded_velocities_do_not_survive_resampling(circles):
    result = preprocess(circles, PreprocessConfig(resample_points=200, velocity=RECORDED))
    time_s = result[0].time_s
    expected = 0.1 * np.pi / 2 * np.stack([-np.sin(np.pi / 2 * time_s), np.cos(np.pi / 2 * time_s)], axis=1)
    np.testing.assert_allclose(result[0].channels["velocity_m_per_s"], expected, atol=1e-4)
    assert result.steps[-1].startswith("estimated velocities")


def test_smoothing_keeps_cubics_and_removes_noise():
    time_s = np.linspace(0, 2, 201)
    cubic = np.stack([time_s**3 - time_s, 2 * time_s**2], axis=1)
    config = PreprocessConfig(smooth_window_s=0.3)
    clean = preprocess(one(time_s, position_m=cubic), config)
    np.testing.assert_allclose(clean[0].channels["position_m"], cubic, atol=1e-12)
    noise = 0.01 * np.random.default_rng(0).standard_normal(cubic.shape)
    noisy = preprocess(one(time_s, position_m=cubic + noise), config)
    assert np.std(noisy[0].channels["position_m"] - cubic) < 0.4 * np.std(noise)


@pytest.mark.parametrize(("window_s", "words"), [(0.01, "0.04 s to 2 s"), (2.5, "0.04 s to 2 s")])
def test_a_smoothing_window_that_cannot_be_is_refused_with_the_range(window_s, words):
    time_s = np.linspace(0, 2, 201)
    with pytest.raises(InvalidSetting, match=words):
        preprocess(one(time_s, position_m=np.zeros((201, 2))), PreprocessConfig(smooth_window_s=window_s))


def test_smoothing_uneven_times_is_refused_until_they_are_resampled(circles):
    with pytest.raises(InvalidSetting, match="resample_points"):
        preprocess(circles, PreprocessConfig(smooth_window_s=0.2))
    assert preprocess(circles, PreprocessConfig(smooth_window_s=0.2, resample_points=80))


def test_aligned_demonstrations_end_at_their_mean_end_point(poses):
    result = preprocess(poses, PreprocessConfig(align_end=True))
    for channel in ("position_m", "joints_rad"):
        ends = np.array([trajectory.channels[channel][-1] for trajectory in result.trajectories])
        mean = np.mean([trajectory.channels[channel][-1] for trajectory in poses.trajectories], axis=0)
        np.testing.assert_allclose(ends, np.stack([mean, mean]), atol=1e-15)
    shift = result[1].channels["position_m"] - poses[1].channels["position_m"]
    np.testing.assert_allclose(shift, np.broadcast_to(shift[0], shift.shape), atol=1e-14)


def test_scaling_scales_positions_with_their_velocities_only(circles, poses):
    result = preprocess(circles, PreprocessConfig(scale=2.0, velocity=RECORDED))
    for name in ("position_m", "velocity_m_per_s"):
        np.testing.assert_array_equal(result[0].channels[name], 2 * circles[0].channels[name])
    np.testing.assert_array_equal(result[0].time_s, circles[0].time_s)
    turned = preprocess(poses, PreprocessConfig(scale=2.0))
    np.testing.assert_array_equal(turned[0].channels["joints_rad"], poses[0].channels["joints_rad"])


def test_quaternions_become_unit_and_continuous_in_time_and_across_demonstrations(poses):
    def spoil(trajectory, signs):
        q = 1.003 * trajectory.channels["orientation_wxyz"] * np.asarray(signs, dtype=float)[: len(trajectory), None]
        return Trajectory(trajectory.time_s, {**trajectory.channels, "orientation_wxyz": q})

    flips = np.random.default_rng(1).choice([-1, 1], 41)
    flips[0] = 1
    spoiled = Demonstrations("test", (spoil(poses[0], flips), spoil(poses[1], -np.ones(41))), "R3xS3")
    result = preprocess(spoiled, PreprocessConfig())
    for found, expected in zip(result.trajectories, poses.trajectories, strict=True):
        np.testing.assert_allclose(
            found.channels["orientation_wxyz"], expected.channels["orientation_wxyz"], atol=1e-14
        )
    assert "quaternions" in result.steps[0]


def test_resampled_quaternions_stay_unit_and_on_their_rotation(poses):
    result = preprocess(poses, PreprocessConfig(resample_points=100))
    q = result[0].channels["orientation_wxyz"]
    half = result[0].time_s / 2
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, atol=1e-15)
    np.testing.assert_allclose(q[:, [0, 3]], np.stack([np.cos(half), np.sin(half)], axis=1), atol=1e-8)


def turning(q_norm=1.0, signs=None):
    """Ten orientations that turn about z, of any length and with any signs."""
    half = np.linspace(0, 1, 10)
    q = np.stack([np.cos(half), np.zeros(10), np.zeros(10), np.sin(half)], axis=1)
    return one(
        np.arange(10), orientation_wxyz=q * np.broadcast_to(q_norm, (10,))[:, None] * (1 if signs is None else signs)
    )


def test_mended_quaternions_are_counted_in_one_warning(caplog):
    lengths = np.ones(10)
    lengths[[2, 5, 6]] = 1.4, 0.997, 1.00001
    signs = np.array([1, 1, -1, 1, 1, 1, 1, -1, -1, -1.0])[:, None]  # three changes
    result = preprocess(turning(lengths, signs), PreprocessConfig())
    (record,) = caplog.records
    assert (record.name, record.levelname) == ("geomotion", "WARNING")
    assert record.getMessage() == "test: mended 3 quaternions that were not of unit length and 3 flips of their sign"
    np.testing.assert_allclose(np.linalg.norm(result[0].channels["orientation_wxyz"], axis=1), 1, atol=1e-15)


def test_quaternions_that_need_no_mending_are_met_with_silence(caplog, poses):
    assert not any("quaternions" in step for step in preprocess(poses, PreprocessConfig()).steps)
    single = turning(1 + 5e-8)  # as single precision has them: normalised and recorded, but nothing to worry about
    assert "normalised quaternions" in preprocess(single, PreprocessConfig()).steps[0]
    assert not caplog.records


def test_a_demonstration_recorded_on_the_other_half_of_the_sphere_counts_as_one_flip(caplog, poses):
    other = Trajectory(
        poses[1].time_s, {**poses[1].channels, "orientation_wxyz": -poses[1].channels["orientation_wxyz"]}
    )
    preprocess(Demonstrations("test", (poses[0], other), "R3xS3"), PreprocessConfig())
    assert "mended 0 quaternions that were not of unit length and 1 flips of their sign" in caplog.text


def test_directions_become_unit_and_keep_their_signs(caplog):
    angle = np.linspace(0, np.pi, 12)
    d = np.stack([np.cos(angle), np.sin(angle), np.zeros(12)], axis=1)
    d[6:] *= -1  # a jump to the other side is a fact, not a convention
    result = preprocess(one(np.arange(12), direction_xyz=1.004 * d), PreprocessConfig())
    np.testing.assert_allclose(result[0].channels["direction_xyz"], d, atol=1e-15)
    assert result.steps == ("normalised directions",)
    assert "mended 12 directions that were not of unit length" in caplog.text


def test_resampled_directions_stay_on_the_sphere():
    angle = np.linspace(0, 2, 40)
    d = np.stack([np.cos(angle), np.sin(angle), np.zeros(40)], axis=1)
    result = preprocess(one(np.linspace(0, 2, 40), direction_xyz=d), PreprocessConfig(resample_points=77))
    expected = np.linspace(0, 2, 77)
    found = result[0].channels["direction_xyz"]
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, atol=1e-15)
    np.testing.assert_allclose(found[:, 0], np.cos(expected), atol=1e-6)
