"""Any arm in the simulator: where its base is, which links are measured, what cannot be loaded."""

import shutil

import numpy as np
import pytest

from geomotion.arms import PLANAR_URDF
from geomotion.errors import InvalidSetting
from geomotion.robot import panda
from geomotion.robot.arm import Arm, read_arm
from geomotion.robot.closed_loop import closed_loop
from geomotion.robot.grasp import GraspedCylinder
from geomotion.robot.panda_arm import panda_arm
from geomotion.robot.scene import ArmScene
from geomotion.robot.timing import fastest
from geomotion.robot.tracking import follow

from .arms import NAMES, shipped_cases, some_joints, write_crooked

WORLD, FOREARM = "base that is no root", "part of an arm"


def arm_of(name: str, folder) -> Arm:
    if name == FOREARM:
        return panda_arm("panda_link3", "panda_link6")
    case = write_crooked(folder) if name in ("crooked", WORLD) else shipped_cases()[name]
    return read_arm(case.path, "one" if name == WORLD else case.base, case.tip)


@pytest.mark.parametrize("name", [*NAMES, WORLD, FOREARM])
def test_the_tip_is_where_kinematics_say_in_the_frame_of_the_base(name, tmp_path):
    arm = arm_of(name, tmp_path)
    with ArmScene(arm) as scene:
        assert set(scene.body_names) == {shape.link for shape in arm.shapes}
        for q in some_joints(arm, 5):
            scene.set_joints(q)
            position_m, wxyz = scene.end_effector_pose()
            expected_m, turned = arm.chain.pose(q)
            np.testing.assert_allclose(position_m, expected_m, atol=1e-6)
            assert abs(wxyz @ turned) == pytest.approx(1, abs=1e-6)


def test_other_joints_stay_where_they_rest_while_the_arm_moves(tmp_path):
    arm = panda_arm("panda_link3", "panda_link6")
    with ArmScene(arm) as scene:
        follow(scene, fastest(np.linspace([-1.0, 0, 0], [-1.5, 0.5, 0.5], 10), arm.limits, 0.5))
        simulated = scene.simulated
        for name, position in arm.resting.items():
            found = scene.client.getJointState(simulated.body, simulated.joint_index[name])[0]
            assert found == pytest.approx(position, abs=2e-3)


def test_an_endless_joint_has_a_margin_without_bound_and_is_timed_by_acceleration(tmp_path):
    path = tmp_path / "endless.urdf"
    text = PLANAR_URDF.read_text().replace('type="revolute"', 'type="continuous"')
    path.write_text(text.replace('lower="-3.1416" upper="3.1416" velocity="2.0"', 'velocity="1e9"'))
    arm = read_arm(path, "base", "tip")
    motion = fastest(np.linspace([0.0, 0.0], [8.0, 1.0], 20), arm.limits)
    assert np.isfinite(motion.duration_s) and motion.use.acceleration <= 1 + 1e-9
    with ArmScene(arm) as scene:
        tracking = follow(scene, motion)
    assert np.isinf(tracking.limit_margin_rad).all()
    assert tracking.position_error_m.max() < 2e-3


def test_an_arm_without_a_known_hand_holds_nothing_and_takes_no_poses():
    with ArmScene(read_arm(PLANAR_URDF, "base", "tip")) as scene:
        with pytest.raises(InvalidSetting, match=r"planning\.tool_radius_m.*nothing is known of a hand"):
            scene.attach(GraspedCylinder(0.03, 0.1))
        pose = np.array([0.4, 0.1, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])
        with pytest.raises(InvalidSetting, match="other arms take configurations"):
            closed_loop(scene, lambda *_: pose, np.zeros(2), 1.0)


def test_meshes_that_are_missing_are_an_error_and_no_links_without_surface(tmp_path):
    shutil.copy(panda.urdf_path(), tmp_path / "panda.urdf")
    arm = read_arm(tmp_path / "panda.urdf", panda.BASE_LINK, "panda_link8")
    with pytest.raises(InvalidSetting, match="PyBullet"), ArmScene(arm):
        pass
