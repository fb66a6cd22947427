from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geomotion.config import AngleUnit, LengthUnit, MmmDataset
from geomotion.demos.preprocessing import preprocess
from geomotion.demos.readers import read, read_skeleton
from geomotion.demos.readers.mmm import roll_pitch_yaw
from geomotion.errors import DatasetError, InvalidSetting, MissingData, UnknownName

from .mmm_files import BODY, NAMES, TIMES, document, kinematic, legacy, model_pose, motion, swinging


@pytest.fixture
def recording(tmp_path):
    def write(text, name="motion.xml"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return str(path)

    return write


def loaded(path, **settings):
    return read(MmmDataset(path=path, **settings))


def test_the_legacy_layout_is_read_in_metres_radians_and_seconds(recording):
    demonstrations = loaded(recording(legacy()))
    one = demonstrations[0]
    assert demonstrations.joint_names == NAMES
    assert demonstrations.space == "R3xS3xjoint"
    np.testing.assert_array_equal(one.time_s, TIMES)
    np.testing.assert_allclose(one.channels["joints_rad"], swinging(TIMES), atol=1e-8)
    np.testing.assert_allclose(one.channels["position_m"][2], [0.02, 0.02, 0.95])


def test_rotations_are_roll_then_pitch_then_yaw_about_axes_at_rest(recording):
    turned = Rotation.from_quat(loaded(recording(legacy()))[0].channels["orientation_wxyz"][1], scalar_first=True)
    x, y, z = (Rotation.from_rotvec(angle * np.eye(3)[axis]) for axis, angle in enumerate([0.1, 0.2, 1.3]))
    np.testing.assert_allclose(turned.as_matrix(), (z * y * x).as_matrix(), atol=1e-7)


def test_yaw_of_any_number_of_turns_is_the_same_rotation():
    angles = np.array([[0.1, -0.2, 3.0], [0.1, -0.2, 3.0 - 2 * np.pi]])
    first, second = roll_pitch_yaw(angles)
    assert (first.inv() * second).magnitude() < 1e-12


def test_sensors_of_any_number_and_rate_come_onto_one_clock(recording):
    finer = np.arange(-1, 8) * 0.005
    line = np.stack([1000 * finer, 0 * finer, 0 * finer + 900], axis=1)
    yaw = np.stack([0 * finer, 0 * finer, 3.1 + 10 * finer], axis=1)  # over π
    fingers = [f"finger_{number}" for number in range(37)]
    text = document(
        motion("<Sensor type='MoCapMarker'><Data/></Sensor>", kinematic(TIMES, NAMES), model_pose(finer, line, yaw)
               , kinematic(finer, fingers, np.outer(finer, np.ones(37)))),
        motion(model_pose(TIMES, [[0, 0, 0]] * 4, [[0, 0, 0]] * 4), name="cup", kind="object"),
    )  # fmt: skip
    demonstrations = loaded(recording(text))
    one = demonstrations[0]
    assert demonstrations.joint_names == (*NAMES, *fingers)
    np.testing.assert_allclose(one.channels["joints_rad"][:, 3:], np.outer(TIMES, np.ones(37)), atol=1e-9)
    np.testing.assert_allclose(one.channels["position_m"][:, 0], TIMES, atol=1e-9)
    between = Rotation.from_quat(one.channels["orientation_wxyz"], scalar_first=True)
    expected = Rotation.from_rotvec(np.outer(3.1 + 10 * np.array(TIMES), [0, 0, 1]))
    assert (between.inv() * expected).magnitude().max() < 1e-6


def test_only_the_time_that_all_sensors_share_is_kept(recording):
    late = [0.02, 0.03, 0.04]
    text = document(motion(kinematic(TIMES, NAMES[:1]), kinematic(late, NAMES[1:])))
    np.testing.assert_array_equal(loaded(recording(text))[0].time_s, [0.02, 0.03])
    text = document(motion(kinematic(TIMES, NAMES[:1]), kinematic([1.0, 1.01], NAMES[1:])))
    with pytest.raises(DatasetError, match=r"less than two times in common.*from 0 to 0.03 s.*from 1 to 1.01 s"):
        loaded(recording(text))


def test_a_motion_without_a_root_is_joints_alone(recording):
    demonstrations = loaded(recording(document(motion(kinematic(TIMES, NAMES)))))
    assert demonstrations.channel_names == ("joints_rad",)


def test_a_motion_is_chosen_by_name_where_several_people_move(recording):
    cup = motion(model_pose(TIMES, [[0, 0, 0]] * 4, [[0, 0, 0]] * 4), name="cup", kind="object")
    people = motion(kinematic(TIMES, NAMES)), motion(kinematic(TIMES, NAMES[:2]), name="other")
    path = recording(document(*people, cup))
    with pytest.raises(DatasetError, match=r"several motions with joints \('walk', 'other'\).*dataset.motion="):
        loaded(path)
    assert loaded(path, motion="other").joint_names == NAMES[:2]
    with pytest.raises(UnknownName, match="Did you mean 'other'"):
        loaded(path, motion="othr")
    with pytest.raises(DatasetError, match="no joint positions in 'cup';"):
        loaded(path, motion="cup")


def test_recordings_with_the_same_joints_in_another_order_are_joined_by_name(recording):
    first, turned = recording(legacy()), recording(legacy(names=NAMES[::-1]), "turned.xml")
    demonstrations = loaded(first, further_paths=[turned])
    np.testing.assert_allclose(demonstrations[1].channels["joints_rad"], swinging(TIMES)[:, ::-1], atol=1e-8)


def test_recordings_with_other_joints_are_refused_until_common_ones_are_chosen(recording):
    first, fewer = recording(legacy()), recording(legacy(names=NAMES[:2]), "fewer.xml")
    with pytest.raises(DatasetError, match=r"it lacks RKx_joint and has none.*dataset.joints="):
        loaded(first, further_paths=[fewer])
    assert loaded(first, further_paths=[fewer], joints=["LKx_joint"]).joint_names == ("LKx_joint",)
    with pytest.raises(UnknownName, match="RKx_joint"):
        loaded(first, further_paths=[fewer], joints=["RKx_joint"])


def test_perturbed_copies_are_smooth_seeded_and_said_to_be_so(recording):
    times = np.round(np.arange(0, 1, 0.01), 2)
    path = recording(legacy(times=times))
    demonstrations = loaded(path, perturbed=2, perturbation_rad=0.1)
    again, other = loaded(path, perturbed=2, perturbation_rad=0.1), loaded(path, perturbed=2, seed=1)
    departures = [one.channels["joints_rad"] - swinging(times) for one in demonstrations.trajectories]
    assert np.abs(departures[0]).max() < 1e-8
    assert 0.03 < departures[1].std() < 0.3
    assert np.abs(np.diff(departures[1], axis=0)).max() < 0.05
    assert np.abs(departures[1] - departures[2]).max() > 0.05
    np.testing.assert_array_equal(again[1].channels["joints_rad"], demonstrations[1].channels["joints_rad"])
    assert np.abs(other[1].channels["joints_rad"] - demonstrations[1].channels["joints_rad"]).max() > 0.01
    assert "not recorded" in demonstrations.steps[0]
    assert demonstrations[1].label.endswith("perturbed 0")


def without(tag):
    return lambda number, frame: frame.replace(tag, "Nothing") if number == 2 else frame


def instead(old, new):
    return lambda number, frame: frame.replace(old, new) if number == 2 else frame


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<Robot/>", "not an MMM motion: it begins with <Robot>"),
        ("<MMM/>", "holds no <Motion>"),
        (legacy(edit=without("JointPosition")), "frame 2 has no <JointPosition>; expected 3 numbers"),
        (legacy(edit=without("RootRotation")), "frame 2 has no <RootRotation>"),
        (legacy(edit=without("Timestep")), "frame 2 has no time step"),
        (legacy(edit=instead("<Timestep>0.02", "<Timestep>0.01")), "frame 2: time 0.01 s does not come after 0.01 s"),
        (legacy(edit=instead("<Timestep>0.02", "<Timestep>two")), "frame 2: the time step is 'two'; expected seconds"),
        (legacy(edit=instead("<JointPosition>", "<JointPosition>1 ")), "frame 2: <JointPosition> has 4 numbers"),
        (legacy(edit=instead("<JointPosition>", "<JointPosition>x")), "frame 2: <JointPosition> is not numbers"),
        (legacy(joints=swinging(TIMES) * [1, np.nan, 1]), "frame 0: number 1 of <JointPosition> is nan"),
        (legacy(joints=50 * swinging(TIMES)), "joint is .* more than a whole turn.*dataset.angle_unit=deg"),
        (legacy(edit=lambda number, frame: frame.replace("950<", "0.95<")), "in mm; .*set dataset.length_unit="),
        (legacy(times=[0, 0.01, 0.02, 0.2]), "about 17 frames are missing between frame 2 at 0.02 s and frame 3"),
        (legacy(times=[0.0]), "has one frame; expected two or more"),
        (legacy(names=["a", "b", "a"]), "gives positions of 'a' more than once"),
        (legacy(height="180"), "the height of the person is '180'; expected metres"),
        (legacy().replace("JointOrder", "Order"), "no <JointOrder>"),
        (document(motion(model_pose(TIMES, [[0, 0, 1]] * 4, [[0, 0, 0]] * 4))), "has no joint positions in 'walk'"),
        (document(motion(kinematic(TIMES, []))), "names no <Joint>"),
        (document(motion(kinematic([], NAMES))), "holds no <Measurement>"),
        (document(motion(*[model_pose(TIMES, [[0, 0, 1]] * 4, [[0, 0, 0]] * 4)] * 2)), "2 ModelPose sensors"),
    ],
)
def test_what_is_wrong_is_said_with_the_frame(recording, text, message):
    with pytest.raises(DatasetError, match=message) as caught:
        loaded(recording(text))
    assert "motion.xml" in str(caught.value)


def test_single_lost_frames_are_left_to_the_time_stamps(recording):
    times = [0.0, 0.01, 0.02, 0.04, 0.05]
    np.testing.assert_array_equal(loaded(recording(legacy(times=times)))[0].time_s, times)


def test_other_units_are_read_where_they_are_said(recording):
    text = legacy(joints=np.degrees(swinging(TIMES)), edit=lambda number, frame: frame.replace("950<", "0.95<"))
    one = loaded(recording(text), angle_unit=AngleUnit.deg, length_unit=LengthUnit.m)[0]
    np.testing.assert_allclose(one.channels["joints_rad"], swinging(TIMES), atol=1e-8)
    assert one.channels["position_m"][0, 2] == 0.95


def test_the_model_beside_the_recording_is_found_and_scaled(recording):
    path = recording(legacy())
    config = MmmDataset(path=path)
    assert read_skeleton(config, read(config)) is None
    alone = MmmDataset(path=recording(legacy().replace("body.xml", "/"), "mmm.xml"))
    assert read_skeleton(alone, read(alone)) is None  # neither the recording itself nor a file without a name
    recording(BODY, "body.xml")
    skeleton = read_skeleton(config, read(config))
    assert skeleton is not None
    places = skeleton.positions(np.zeros((1, 3)), NAMES, np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]))
    np.testing.assert_allclose(places[0, 2], [0, 0, 1.8 * 0.45])
    assert places[0, 2, 2] < read_skeleton(MmmDataset(path=path, height_m=2.0), read(config)).nodes[1].place[2][3] * 2


def test_a_file_that_merely_lies_beside_the_recording_does_not_stop_it(recording, caplog):
    path = recording(legacy(names=["a", "b", "c"]))
    for text, words in ((BODY, "none of the recorded joints a, b, c"), ("<Robot>", "mmm.xml")):
        recording(text, "mmm.xml")
        caplog.clear()
        assert read_skeleton(MmmDataset(path=path), loaded(path)) is None
        assert words in caplog.text and "the person is not drawn by it" in caplog.text
        with pytest.raises(DatasetError, match=r"mmm\.xml"):
            read_skeleton(MmmDataset(path=path, skeleton=str(Path(path).with_name("mmm.xml"))), loaded(path))


def test_a_model_that_does_not_fit_is_refused(recording):
    path = recording(legacy(names=["a", "b", "c"]))
    with pytest.raises(MissingData, match=r"nobody\.xml"):
        read_skeleton(MmmDataset(path=path, skeleton="nobody.xml"), loaded(path))
    with pytest.raises(DatasetError, match="none of the recorded joints a, b, c"):
        read_skeleton(MmmDataset(path=path, skeleton=recording(BODY, "other.xml")), loaded(path))
    unmeasured = recording(legacy().replace("<Height>1.8</Height>", ""), "unmeasured.xml")
    with pytest.raises(DatasetError, match=r"set dataset\.height_m="):
        read_skeleton(MmmDataset(path=unmeasured, skeleton=recording(BODY, "other.xml")), loaded(unmeasured))


@pytest.mark.parametrize("settings", [{"joints": []}, {"joints": ["a", "a"]}, {"height_m": 180.0}, {"perturbed": -1}])
def test_settings_that_make_no_sense_are_refused(settings):
    with pytest.raises(InvalidSetting, match=f"dataset.{next(iter(settings))}"):
        MmmDataset(path="x", **settings)


def test_a_real_recording_walks_where_it_faces_with_its_feet_on_the_ground(mmm_folder):
    config = MmmDataset(path=str(mmm_folder / "00001_mmm.xml"))
    demonstrations = preprocess(read(config), config.preprocess)
    one, skeleton = demonstrations[0], read_skeleton(config, demonstrations)
    joints_rad, position_m = one.channels["joints_rad"], one.channels["position_m"]
    assert joints_rad.shape == (378, 44)
    assert one.duration_s == pytest.approx(3.77)
    facing = Rotation.from_quat(one.channels["orientation_wxyz"], scalar_first=True).apply([0, 1, 0]).mean(axis=0)
    way = position_m[-1] - position_m[0]
    assert facing @ way / np.linalg.norm(way) > 0.95
    assert skeleton is not None
    places = skeleton.positions(joints_rad, demonstrations.joint_names, position_m, one.channels["orientation_wxyz"])
    assert -0.02 < places[..., 2].min() < 0.05
    assert 1.7 < np.ptp(places[..., 2], axis=1).mean() < 2.1
