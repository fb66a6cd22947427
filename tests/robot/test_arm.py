"""Any serial arm from its URDF: against pytorch-kinematics and PyBullet; what is refused, and how."""

from pathlib import Path

import numpy as np
import pytest
import torch

from geomotion.errors import InvalidSetting, MissingData, ShapeMismatch, UnknownName
from geomotion.robot import panda
from geomotion.robot.arm import Arm, read_arm
from geomotion.robot.body import BodyPoints
from geomotion.robot.chain import panda_chain
from geomotion.robot.quiet import quiet

from .arms import CROOKED, NAMES, Case, shipped_cases, some_joints, write_crooked


@pytest.fixture(scope="module")
def cases(tmp_path_factory) -> dict[str, Case]:
    return shipped_cases() | {"crooked": write_crooked(tmp_path_factory.mktemp("urdf"))}


@pytest.fixture(params=NAMES)
def case(request, cases) -> Case:
    return cases[request.param]


def random_body(arm: Arm, count: int = 20) -> BodyPoints:
    random = np.random.default_rng(1)
    frames = random.integers(0, len(arm.joint_names), count)
    return BodyPoints(frames, random.normal(scale=0.2, size=(count, 3)), np.zeros(count))


def test_all_frames_are_those_of_pytorch_kinematics(cases):
    import pytorch_kinematics

    for name in ("panda", "iiwa", "planar"):
        case = cases[name]
        arm = case.arm()
        with quiet():
            reference = pytorch_kinematics.build_serial_chain_from_urdf(case.path.read_bytes(), case.tip, case.base)
        assert reference.get_joint_parameter_names() == list(arm.joint_names)
        q = some_joints(arm, 20)
        found = reference.to(dtype=torch.float64).forward_kinematics(torch.from_numpy(q), end_only=False)
        links = [frame.name for frame in reference._serial_frames if frame.joint.joint_type != "fixed"]
        expected = np.stack([found[link].get_matrix()[:, :3, 3].numpy() for link in [*links, case.tip]], axis=1)
        np.testing.assert_allclose(arm.chain.points(q, arm.joint_points()), expected, atol=1e-6)  # its offsets: float32


def test_points_of_every_link_are_where_the_simulator_has_them(case):
    import pybullet
    from pybullet_utils.bullet_client import BulletClient

    arm = case.arm()
    with quiet():
        client = BulletClient(pybullet.DIRECT)
        body = client.loadURDF(str(case.path), useFixedBase=True)
    infos = [client.getJointInfo(body, index) for index in range(client.getNumJoints(body))]
    joint = {info[1].decode(): info[0] for info in infos}
    link = {info[12].decode(): info[0] for info in infos}

    def pose(name: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
        if name not in link:  # the root, which was put there
            return (0, 0, 0), (0, 0, 0, 1)
        return client.getLinkState(body, link[name], computeForwardKinematics=1)[4:6]

    local = random_body(arm)
    for q in some_joints(arm, 10):
        for name, angle in zip(arm.joint_names, q, strict=True):
            client.resetJointState(body, joint[name], float(angle))
        to_base = client.invertTransform(*pose(case.base))
        placed = [pose(infos[joint[arm.joint_names[frame]]][12].decode()) for frame in local.frame]
        expected = [
            client.multiplyTransforms(*to_base, *client.multiplyTransforms(*at, offset, (0, 0, 0, 1)))[0]
            for at, offset in zip(placed, local.offset_m.tolist(), strict=True)
        ]
        np.testing.assert_allclose(arm.chain.points(q, local), expected, atol=2e-6)
    client.disconnect()


def test_batches_give_the_same_as_single_configurations(cases):
    arm = cases["crooked"].arm()
    q, body = some_joints(arm, 6).reshape(2, 3, -1), random_body(arm)
    points = arm.chain.points(q, body)
    assert points.shape == (2, 3, len(body), 3)
    np.testing.assert_allclose(points[1, 2], arm.chain.points(q[1, 2], body), atol=1e-15)
    np.testing.assert_allclose(arm.chain.points(q, arm.joint_points())[..., -1, :], arm.chain.pose(q)[0], atol=1e-15)
    assert arm.chain.points(q[:0], body).shape == (0, 3, len(body), 3)
    with pytest.raises(ShapeMismatch, match="joint positions"):
        arm.chain.points(q[..., :2], body)


def test_many_configurations_at_once_are_the_same_as_few(cases):
    arm = cases["panda"].arm()
    q, body = some_joints(arm, 5000), arm.joint_points()
    np.testing.assert_allclose(arm.chain.points(q, body)[4000:4003], arm.chain.points(q[4000:4003], body), atol=1e-14)


def test_no_point_moves_farther_than_its_reach_allows(case):
    arm = case.arm()
    body, count = random_body(arm), 2000
    q = some_joints(arm, count)
    step = np.random.default_rng(2).normal(size=q.shape) * np.logspace(-4, 0, count)[:, None]
    moved = np.linalg.norm(arm.chain.points(q + step, body) - arm.chain.points(q, body), axis=-1)
    assert (moved <= np.abs(step) @ arm.chain.reach_m(body) + 1e-12).all()


def test_the_reach_is_attained_where_links_are_in_line(cases):
    arm = cases["planar"].arm()
    np.testing.assert_allclose(arm.chain.reach_m(arm.joint_points()), [[0, 0.3, 0.55], [0, 0, 0.25]], atol=1e-12)


def test_joint_points_are_the_joints_and_the_tip_and_what_is_asked_for_between(cases):
    arm = cases["panda"].arm()
    points = arm.joint_points()
    assert len(points) == 8 and not points.radius_m.any()
    apart = 5  # of the panda's segments; joints 2, and 6 are where those before them are
    assert len(arm.joint_points(between=2)) == 8 + 2 * apart
    thirds = cases["planar"].arm().joint_points(between=2)
    np.testing.assert_allclose(thirds.offset_m[:, 0], [0, 0.1, 0.2, 0, 0.25 / 3, 0.5 / 3, 0.25])
    with pytest.raises(InvalidSetting, match="between"):
        arm.joint_points(between=-1)


def test_the_panda_of_its_urdf_is_the_documented_one(cases):
    arm = cases["panda"].arm()
    assert arm.joint_names == panda.JOINTS
    for name in ("lower_rad", "upper_rad", "velocity_rad_per_s"):
        np.testing.assert_array_equal(getattr(arm.limits, name), getattr(panda.LIMITS, name))
    for name in ("before", "axes", "tip"):
        np.testing.assert_array_equal(getattr(arm.chain, name), getattr(panda_chain("grasp_target"), name))


def test_limits_are_the_narrower_ones_and_none_where_a_joint_has_no_end(cases):
    limits = cases["crooked"].arm().limits
    np.testing.assert_array_equal(limits.lower_rad, [-np.inf, -0.9, -2])
    np.testing.assert_array_equal(limits.upper_rad, [np.inf, 2, 2])
    np.testing.assert_array_equal(limits.velocity_rad_per_s, [np.inf, 1.5, 1.5])
    np.testing.assert_array_equal(limits.margin_rad(np.array([[100.0, 0.0, 1.5]])), [0.5])


def test_nothing_is_printed(cases, capfd):
    cases["panda"].arm()
    cases["xarm"].arm()
    assert capfd.readouterr() == ("", "")


def test_a_file_that_is_missing_is_asked_for(tmp_path):
    with pytest.raises(MissingData, match=r"nowhere\.urdf not found\. Name an existing file with arm\.urdf="):
        read_arm(tmp_path / "nowhere.urdf", "base", "tip")


REVOLUTE = '<joint name="b" type="revolute">'
REFUSED = {
    "no XML": ("<robot", "<robot<", "a URDF file"),
    "no robot": (CROOKED, "<sdf/>", "a URDF with links"),
    "unknown type of joint": (REVOLUTE, '<joint name="b" type="bend">', "a URDF file.*bend"),
    "no number": ("0.05 0 0.2", "0.05 0 up", "a URDF file.*float"),
    "two coordinates": ("0.05 0 0.2", "0.05 0", "a URDF file"),
    "slide": (REVOLUTE, '<joint name="b" type="prismatic">', "prismatic joint 'b'.*revolute, continuous and fixed"),
    "mimic": ("<axis xyz=\"0 -2 0\"/>", '<axis xyz="0 1 0"/><mimic joint="c"/>', "'b', which mimics another"),
    "no axis": ("0 -2 0", "0 0 0", "joint 'b' with axis.*a direction"),
    "empty range": ('lower="-1" upper="2"', 'lower="1" upper="1"', "joint 'b' from 1 to 1 rad"),
    "no speed": ('velocity="1.5" effort="1"/>\n    <safety', 'velocity="0" effort="1"/>\n    <safety', "speed above 0"),
    "no limits": ('<limit lower="-2" upper="2" velocity="1.5" effort="1"/>', "", "joint 'c' without limits"),
    "lost link": ('<link name="two"/>', "", "has the links of its joint 'b'"),
    "circle": ('<parent link="world"/>', '<parent link="tip"/>', "goes in a circle"),
}  # fmt: skip


@pytest.mark.parametrize("old,new,message", REFUSED.values(), ids=REFUSED)
def test_what_is_no_serial_arm_is_refused_in_one_line(old, new, message, tmp_path):
    assert old in CROOKED
    path = tmp_path / "arm.urdf"
    path.write_text(CROOKED.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InvalidSetting, match=message) as refused:
        read_arm(path, "base", "tip")
    assert "\n" not in str(refused.value)


def test_links_must_be_known_and_one_must_carry_the_other(cases):
    path: Path = cases["crooked"].path
    with pytest.raises(UnknownName, match=r"unknown link of crooked\.urdf 'tipp'\. Did you mean 'tip'\?.*three, tip"):
        read_arm(path, "base", "tipp")
    with pytest.raises(InvalidSetting, match=r"arm\.base_link=tip"):
        read_arm(path, "tip", "base")
    with pytest.raises(InvalidSetting, match=r"arm\.base_link=base"):
        read_arm(path, "base", "base")
    with pytest.raises(InvalidSetting, match=r"arm\.tip_link=base"):
        read_arm(path, "world", "base")
