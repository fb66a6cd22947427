from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geomotion.errors import DatasetError, MissingData
from geomotion.robot.skeleton import Node, Skeleton, read_simox

STRAIGHT = tuple(map(tuple, np.eye(4).tolist()))
MM = "<Transform><Translation x='0' y='0' z='{length}'/></Transform>"


def up(length):
    place = np.eye(4)
    place[2, 3] = length
    return tuple(map(tuple, place.tolist()))


CHAIN = Skeleton(
    (
        Node("root", -1, STRAIGHT, "fixed", (0.0, 0.0, 1.0)),
        Node("hinge", 0, up(0.5), "revolute", (1.0, 0.0, 0.0)),
        Node("slide", 1, up(0.3), "prismatic", (0.0, 0.0, 1.0)),
        Node("tip", 2, up(0.2), "fixed", (0.0, 0.0, 1.0)),
        Node("other", 0, up(-0.4), "fixed", (0.0, 0.0, 1.0)),
    )
)


def places(joints, names, root=(0.0, 0.0, 0.0), wxyz=(1.0, 0.0, 0.0, 0.0)):
    joints = np.atleast_2d(joints)
    return CHAIN.positions(joints, names, np.tile(root, (len(joints), 1)), np.tile(wxyz, (len(joints), 1)))


def test_a_chain_follows_its_closed_form():
    angles, slides = np.linspace(-2, 2, 7), np.linspace(0, 0.1, 7)
    found = places(np.stack([slides, angles], axis=1), ["slide", "hinge"])
    direction = np.stack([0 * angles, -np.sin(angles), np.cos(angles)], axis=1)
    np.testing.assert_allclose(found[:, 2], [0, 0, 0.5] + (0.3 + slides)[:, None] * direction, atol=1e-12)
    np.testing.assert_allclose(found[:, 3], [0, 0, 0.5] + (0.5 + slides)[:, None] * direction, atol=1e-12)
    np.testing.assert_allclose(found[:, 4], np.tile([0, 0, -0.4], (7, 1)), atol=1e-12)


def test_the_root_carries_everything():
    turned = Rotation.from_euler("xyz", [0.3, -0.2, 1.0])
    joints, names = [[0.05, 0.7]], ["slide", "hinge"]
    moved = places(joints, names, (1.0, 2.0, 3.0), turned.as_quat(scalar_first=True))
    np.testing.assert_allclose(moved[0], turned.apply(places(joints, names)[0]) + np.array([1, 2, 3]), atol=1e-12)


def test_bones_keep_their_length_however_joints_turn():
    generator = np.random.default_rng(0)
    found = places(np.stack([np.zeros(20), generator.normal(size=20)], axis=1), ["slide", "hinge"])
    lengths = [np.ptp(np.linalg.norm(found[:, a] - found[:, b], axis=1)) for a, b in CHAIN.bones()]
    assert len(lengths) == 4
    assert max(lengths) < 1e-12


def test_joints_that_the_skeleton_lacks_have_no_effect():
    np.testing.assert_array_equal(places([[0.4, 9.0]], ["hinge", "wing"]), places([[0.4]], ["hinge"]))
    assert CHAIN.known(["wing", "hinge", "tip"]) == ["hinge"]


def test_the_document_makes_the_same_skeleton():
    assert Skeleton.from_document(CHAIN.document()) == CHAIN


def robot(nodes, root="a"):
    return f"<Robot Type='x' RootNode='{root}'>{nodes}</Robot>"


def node(name, inside):
    return f"<RobotNode name='{name}'>{inside}</RobotNode>"


@pytest.fixture
def described(tmp_path):
    def write(text):
        path = tmp_path / "body.xml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_lengths_are_millimetres_and_scaled(described):
    text = robot(node("a", "<Child name='b'/>") + node("b", MM.format(length=250)))
    assert read_simox(described(text), scale=1.8).nodes[1].place[2][3] == pytest.approx(0.45)
    metres = text.replace("z='250'", "z='0.25' units='m'")
    assert read_simox(described(metres), scale=1.8).nodes[1].place[2][3] == pytest.approx(0.45)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<MMM/>", "not a robot of Simox"),
        (robot(node("b", "")), "its root 'a' is none of its 1 nodes"),
        (robot(node("a", "<Child name='b'/>")), "node 'a' has the child 'b', which is not described"),
        (robot(node("a", "<Child name='b'/><Child name='b'/>") + node("b", "")), "node 'b' is carried by two"),
        (robot(node("a", "<Child name='a'/>")), "node 'a' is carried by two"),
        (robot(node("a", "<Joint type='ball'/>")), "joint of type 'ball'"),
        (robot(node("a", "<Transform><DH a='1'/></Transform>")), "placed by <DH>"),
        (robot(node("a", "<Transform><Translation x='0' y='0'/></Transform>")), "needs numbers x, y, z"),
        (robot(node("a", "<Transform><Translation x='0' y='0' z='nan'/></Transform>")), "not finite"),
        (robot(node("a", "<Transform><Translation x='0' y='0' z='0' units='ell'/></Transform>")), "unit 'ell'"),
        (
            robot(node("a", "<Transform><Matrix4x4><row1 c1='1' c2='0' c3='0' c4='0'/></Matrix4x4></Transform>")),
            "1 rows",
        ),
        (robot(node("a", "<Joint type='revolute'><axis x='0' y='0' z='0'/></Joint>")), "axis without a direction"),
    ],
)
def test_what_is_wrong_is_said_with_the_node(described, text, message):
    with pytest.raises(DatasetError, match=message):
        read_simox(described(text))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(MissingData, match=r"body\.xml"):
        read_simox(tmp_path / "body.xml")


def test_the_model_of_the_human_body_is_one_tree_in_proportion(mmm_folder):
    skeleton = read_simox(mmm_folder / "mmm_model.xml", scale=1.0)
    names = [one.name for one in skeleton.nodes]
    assert all(node.parent < number for number, node in enumerate(skeleton.nodes))
    found = skeleton.positions(np.zeros((1, 0)), [], np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]))[0]
    leg = [names.index(name) for name in ("LHx_joint", "LKx_joint", "LAx_joint")]
    assert [np.linalg.norm(found[a] - found[b]) for a, b in pairwise(leg)] == pytest.approx([0.245, 0.246])
    left, right = (found[names.index(f"{side}Wx_joint")] for side in "LR")
    np.testing.assert_allclose(left * [-1, 1, 1], right)
