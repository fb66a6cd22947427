"""The balls that stand for the hand contain it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geomotion.robot import panda

HAND_LINKS = ("panda_hand", "panda_leftfinger", "panda_rightfinger")


def surface_in_frame(scene, frame: panda.Frame) -> np.ndarray:
    """Points on the collision shapes of hand and fingers, which are convex, in a frame of the arm [m]."""
    import trimesh

    client, simulated, found = scene.client, scene.simulated, []
    for link in HAND_LINKS:
        for shape in client.getCollisionShapeData(simulated.body, simulated.link_index[link]):
            *_, scale, file, place, turn = shape
            state = client.getLinkState(simulated.body, simulated.link_index[link], computeForwardKinematics=1)
            at, turned = client.multiplyTransforms(state[0], state[1], place, turn)
            hull = trimesh.load(file.decode(), force="mesh").convex_hull
            sampled, _ = trimesh.sample.sample_surface(hull, 3000, seed=0)
            points_m = np.concatenate([hull.vertices, sampled]) * scale
            found.append(Rotation.from_quat(turned).apply(points_m) + at)
    position_m, xyzw = simulated.link_pose(panda.FRAME_LINKS[frame])
    return Rotation.from_quat(xyzw).inv().apply(np.concatenate(found) - position_m)


@pytest.mark.parametrize("frame", ["grasp_target", "flange"])
def test_the_balls_contain_hand_and_open_fingers(frame, scene):
    surface_m = surface_in_frame(scene, frame)
    centres_m, radii_m = panda.hand_balls(frame)
    outside_m = (np.linalg.norm(surface_m[:, None] - centres_m, axis=2) - radii_m).min(axis=1)
    assert len(surface_m) > 9000
    assert outside_m.max() <= 0


def test_the_balls_are_no_larger_than_the_hand_needs(scene):
    surface_m = surface_in_frame(scene, "grasp_target")
    centres_m, radii_m = panda.hand_balls("grasp_target")
    apart_m = np.linalg.norm(surface_m[:, None] - centres_m, axis=2).min(axis=0)
    assert (apart_m < radii_m).all()
    assert (centres_m + radii_m[:, None] - surface_m.max(axis=0)).max() < 0.06
    assert (surface_m.min(axis=0) - centres_m + radii_m[:, None]).max() < 0.06


def test_both_frames_mean_the_same_balls():
    from geomotion.robot.chain import panda_chain

    centres_m = []
    for frame in ("grasp_target", "flange"):
        position_m, wxyz = panda_chain(frame).pose(panda.HOME_RAD)
        centres_m.append(Rotation.from_quat(wxyz, scalar_first=True).apply(panda.hand_balls(frame)[0]) + position_m)
    np.testing.assert_allclose(*centres_m, atol=1e-6)
