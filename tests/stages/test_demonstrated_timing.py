"""The demonstrations' own timing for other paths."""

import numpy as np
import pytest

from geomotion.stages.demonstrated_timing import share_of_path_at_time

TIME = np.linspace(0, 1, 200)
LAWS = {
    "at rest at both ends": 3 * TIME**2 - 2 * TIME**3,
    "slow, then fast": 0.3 * TIME + 0.7 * TIME**3,
    "even": TIME,
}


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_a_demonstration_gets_its_own_timing(law):
    shares = share_of_path_at_time([law, law], law)
    np.testing.assert_allclose(
        np.interp(shares, TIME, law), np.interp(np.linspace(0, 1, len(shares)), TIME, law), atol=0.02
    )


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_a_path_is_passed_at_the_demonstrated_pace_however_its_points_are_spread(law):
    progress = np.linspace(0, 1, 300) ** 2
    shares = share_of_path_at_time([law], progress)
    done = np.interp(shares, np.linspace(0, 1, 300), progress)
    np.testing.assert_allclose(done, np.interp(np.linspace(0, 1, len(shares)), TIME, law), atol=0.02)


@pytest.mark.parametrize(
    "progress",
    [TIME, TIME[::-1], np.full(50, 0.4), 0.5 + 0.1 * TIME, TIME + 0.1 * np.sin(20 * TIME), np.round(8 * TIME) / 8],
    ids=["forward", "backward", "nowhere", "a part", "to and fro", "in steps"],
)
def test_shares_rise_from_zero_to_one_and_nothing_is_passed_in_no_time(progress):
    shares = share_of_path_at_time(list(LAWS.values()), progress)
    assert shares[0] == 0 and shares[-1] == 1
    assert (np.diff(shares) >= 0).all()
    assert np.diff(shares).max() < 0.3


def test_a_pause_of_the_demonstrations_does_not_stop_a_path_for_ever():
    pause = np.interp(TIME, [0, 0.3, 0.7, 1], [0, 0.5, 0.5, 1])
    shares = share_of_path_at_time([pause], TIME)
    assert (np.diff(shares) > 0).all()
