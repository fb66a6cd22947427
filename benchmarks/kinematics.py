"""Forward kinematics and Jacobians of the Panda for a whole latent grid, pytorch-kinematics beside it.

Run as ``python benchmarks/kinematics.py``. 50³ random configurations and the eight points of Thesis Sec. 4.1, joints
and tip, in double precision. pytorch-kinematics computes the poses of all its frames, from which the points can be
read, and the Jacobian of one point a call. One core.
"""

import time
from collections.abc import Callable

import numpy as np
import pytorch_kinematics
import torch

from geomotion import arms
from geomotion import config as schema
from geomotion.robot import panda
from geomotion.robot.kinematics import ForwardKinematics
from geomotion.robot.quiet import quiet

CONFIGURATIONS = 50**3
REPETITIONS = 5


def fastest_s(call: Callable[[], object]) -> float:
    """Shortest time of some calls after a first one [s]."""
    call()
    times = []
    for _ in range(REPETITIONS):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    torch.set_num_threads(1)
    settings = schema.PandaArm()
    arm = arms.build(settings)
    body = arm.joint_points()
    layer = ForwardKinematics(arm, body)
    with quiet():
        text = panda.urdf_path().read_bytes()
        reference = pytorch_kinematics.build_serial_chain_from_urdf(text, settings.tip_link, settings.base_link)
    reference = reference.to(dtype=torch.float64)
    limits = arm.limits
    q = np.random.default_rng(0).uniform(limits.lower_rad, limits.upper_rad, (CONFIGURATIONS, len(arm.joint_names)))
    configurations = torch.from_numpy(q)
    with torch.no_grad():
        rows = {
            "points": {
                "pytorch-kinematics": lambda: reference.forward_kinematics(configurations, end_only=False),
                "here, numpy": lambda: arm.chain.points(q, body),
                "here, torch": lambda: layer(configurations),
            },
            "Jacobians": {
                "pytorch-kinematics, of one point": lambda: reference.jacobian(configurations),
                "here, torch, of all": lambda: layer.jacobians(configurations),
            },
        }
        print(f"{CONFIGURATIONS} configurations, {len(body)} points: seconds, and how many times faster than the first")
        for what, calls in rows.items():
            times = {name: fastest_s(call) for name, call in calls.items()}
            first = next(iter(times.values()))
            for name, taken_s in times.items():
                print(f"{what:<11}{name:<34}{taken_s:>8.3f} s{first / taken_s:>8.1f}", flush=True)


if __name__ == "__main__":
    main()
