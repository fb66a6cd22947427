"""RoboTasks9 in joint space: every recorded path of poses, solved with several ways of the elbow.

The recordings are poses; joint positions are derived from them and labelled so. A recording that the arm cannot follow
from beginning to end is left out as a whole, and the dataset says which ones and by how much it misses them.
"""

from dataclasses import dataclass

import numpy as np

from geomotion.config import RoboTasks9JointDataset
from geomotion.demos.demonstrations import Demonstrations, Trajectory
from geomotion.demos.generators import elbow
from geomotion.demos.generators.human import recorded
from geomotion.demos.poses import pose_paths
from geomotion.demos.readers import robotasks9
from geomotion.errors import DatasetError
from geomotion.robot.panda import JOINTS
from geomotion.robot.redundancy import SwivelPath, solve_swivel_path
from geomotion.scores.paths import PosePath

DERIVED = "joints_rad are derived from recorded poses, taken as those of the grasp target, by inverse kinematics"


@dataclass(frozen=True)
class _Solved:
    """One recording with one solution of the elbow."""

    recording: int
    solution: int
    found: SwivelPath


def read(config: RoboTasks9JointDataset) -> Demonstrations:
    """Joints [rad] for the poses of one task, all solutions of the first recording, then of the next.

    ``position_m`` [m] and ``orientation_wxyz`` are where the joints bring the grasp target: the recorded poses.

    Raises:
        MissingData: If the file is missing and cannot be downloaded.
        DatasetError: If it is damaged or not what was published, or the arm can follow no recording.
    """
    poses = robotasks9.read(config)
    paths = pose_paths(poses, config.points)
    solved, left_out = _solve(config, paths)
    if not solved:
        reason = f"the arm can follow no recording with every solution of the elbow; it misses {_worst(left_out)}"
        raise DatasetError(poses.name, f"{reason}; change dataset.elbow, or use dataset=robotasks9/{config.task}")

    def trajectory(one: _Solved) -> Trajectory:
        duration_s = poses[one.recording].duration_s
        time_s = np.linspace(0.0, duration_s, config.points)
        near_wxyz = paths[one.recording].orientation
        return recorded(time_s, one.found.path.joints_rad, near_wxyz, elbow.label(config.elbow, one.solution))

    return Demonstrations(
        name=config.name,
        trajectories=tuple(trajectory(one) for one in solved),
        space="joint",
        frame=poses.frame,
        source=f"{poses.source}; {DERIVED}; seed {config.seed}",
        licence=poses.licence,
        steps=(f"resampled to {config.points} poses, even in time", *_record(config, solved, left_out)),
        joint_names=JOINTS,
    )


def _solve(config: RoboTasks9JointDataset, paths: list[PosePath]) -> tuple[list[_Solved], dict[int, float]]:
    """All solutions of the recordings that the arm can follow; of the others, by how much it misses them [m]."""
    solved: list[_Solved] = []
    left_out: dict[int, float] = {}
    for recording, path in enumerate(paths):
        of_recording = []
        for solution in range(config.elbow.solutions):
            seed = (config.seed, recording * config.elbow.solutions + solution)
            wanted = elbow.profile_rad(config.elbow, solution, config.points, config.variation, seed)
            found = solve_swivel_path(path.position_m, path.orientation, wanted)
            if not found.path.reached.all():
                left_out[recording] = float(found.path.position_error_m.max())
                break
            of_recording.append(_Solved(recording, solution, found))
        else:
            solved += of_recording
    return solved, left_out


def _record(config: RoboTasks9JointDataset, solved: list[_Solved], left_out: dict[int, float]) -> list[str]:
    """What was done, one sentence each."""
    steps = [elbow.led(config.elbow)]
    if left_out:
        steps.append(f"left out recordings that the arm cannot follow, missing {_worst(left_out)}")
    errors = np.concatenate([one.found.swivel_error_rad for one in solved])
    missed = np.concatenate([~one.found.attained for one in solved])
    if missed.any():
        steps.append(
            f"joint limits keep the elbow from its angle in {int(missed.sum())} of {len(missed)} poses, "
            f"by {errors.max():.2f} rad at most"
        )
    return steps


def _worst(left_out: dict[int, float]) -> str:
    return ", ".join(f"{recording} by {1000 * error_m:.1f} mm" for recording, error_m in left_out.items())
