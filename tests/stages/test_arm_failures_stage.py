"""The study of Fig. 4.4 on a latent plane that is a level piece of the world, the hand pointing down."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from geomotion import config as schema
from geomotion.errors import InvalidSetting
from geomotion.manifolds.grid import LatentGrid
from geomotion.planning.manifold import DecodedPath
from geomotion.scores.paths import PosePath
from geomotion.scores.pose_support import PoseSupport
from geomotion.stages.arm_failures import study_arm_failures
from geomotion.stages.graph import Skilled

DOWN = np.array([0.0, 1.0, 0.0, 0.0])
CAPS = 0.11, 0.1
CONFIG = schema.ArmFailuresConfig(study=True, points_per_axis=5, solutions=4)
BESIDE = schema.SphereObstacle(centre_m=[0.25, 0.0, 0.6], radius_m=0.12)
FRAME = schema.EndEffectorFrame.grasp_target


class Level:
    """z is the place over the table [m]; one demonstration along the first axis."""

    latent_dim = 2

    def __init__(self) -> None:
        self.codes = [torch.stack([torch.linspace(0.4, 0.6, 9), torch.zeros(9)], dim=1).double()]
        demonstration = self.decode(self.codes[0].numpy()).states
        self.data = SimpleNamespace(originals=(demonstration,), paths=(demonstration,))
        self.space = SimpleNamespace(support=PoseSupport.of)

    def decode(self, z: np.ndarray) -> DecodedPath:
        position_m = np.column_stack([z, np.full(len(z), 0.25)])
        return DecodedPath(PosePath(position_m, np.tile(DOWN, (len(z), 1))), z[:, 0])


def skilled(arm: schema.ArmConfig | None = None) -> Skilled:
    grid, found = LatentGrid(np.array([0.4, -0.2]), np.array([0.6, 0.2]), 20), object.__new__(Skilled)
    vars(found).update(manifold=Level(), skill=SimpleNamespace(arm=arm), surface=SimpleNamespace(grid=grid))
    return found


def test_poses_inside_the_support_cap_are_judged_and_those_nearest_to_demonstrations_named():
    study = study_arm_failures(CONFIG, skilled(), BESIDE, FRAME, CAPS)
    share = study.failures.share
    judged = np.abs(study.failures.axes[1]) <= CAPS[0]
    assert np.isfinite(share[:, judged]).all() and np.isnan(share[:, ~judged]).all()
    scores = {name.removeprefix("arm_failures."): one for name, one in study.evaluation.scores.items()}
    assert scores["worst_share"].value == np.nanmax(share)
    beside = share[:, 2]  # the row of the grid along which the demonstration goes
    assert scores["mean_share_near_demonstrations"].value == pytest.approx(beside.mean())
    assert 0 < scores["mean_share"].value < 1
    assert scores["clearance_of_demonstrated_hands"].value > 50


def test_nothing_touches_an_obstacle_that_is_far_away():
    study = study_arm_failures(CONFIG, skilled(), replace(BESIDE, centre_m=[3.0, 0.0, 0.0]), FRAME, CAPS)
    assert study.evaluation.scores["arm_failures.worst_share"].value == 0


@pytest.mark.parametrize(
    ("arm", "obstacle", "named"),
    [(None, schema.NoObstacle(), "obstacle"), (schema.PandaArm(), BESIDE, "arm_failures")],
    ids=["no obstacle", "configurations"],
)
def test_it_needs_an_obstacle_and_poses(arm, obstacle, named):
    with pytest.raises(InvalidSetting, match=named):
        study_arm_failures(CONFIG, skilled(arm), obstacle, FRAME, CAPS)
