"""Whole-body human motion: recordings as the KIT database has them, one demonstration each, and perturbed copies."""

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from geomotion.config import MmmDataset
from geomotion.demos.columns import METRES_PER, RADIANS_PER, space_of
from geomotion.demos.demonstrations import Array, Demonstrations, Trajectory
from geomotion.demos.generators.human import Spread, wander
from geomotion.demos.readers.mmm_xml import JOINTS, POSITION, ROTATION, Motion, Series, read_motions
from geomotion.errors import DatasetError, UnknownName
from geomotion.robot.skeleton import Skeleton, read_simox

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

MODEL_FILES = ("mmm.xml", "mmm_model.xml")  # of the reference model, as it is handed out
SAME_TIME_S = 1e-6
LONGEST_GAP_FRAMES = 5  # that are taken for lost in transfer, not for two recordings in one
LARGEST_ANGLE_RAD = 2 * np.pi
HEIGHTS_M = (0.05, 50.0)  # how far a person's hip may be from the origin of a laboratory

SOURCE = (
    "in the format of the KIT Whole-Body Human Motion Database: C. Mandery, O. Terlemez, M. Do, N. Vahrenkamp, "
    "T. Asfour, Unifying Representations and Large-Scale Whole-Body Motion Databases for Studying Human Motion, IEEE "
    "Transactions on Robotics, 2016"
)

_log = logging.getLogger("geomotion")


def read(config: MmmDataset) -> Demonstrations:
    """Joint positions [rad], and positions [m] and orientations (wxyz) of the root, where the files give it.

    Raises:
        MissingData: If a file does not exist.
        DatasetError: If one breaks a rule, or they differ in their joints; names file, motion, sensor and frame.
        UnknownName: If there is no such motion or joint.
    """
    paths = [Path(name).expanduser() for name in (config.path, *config.further_paths)]
    motions = [chosen_motion(path, config.motion) for path in paths]
    names = _joints(config, paths, motions)
    recorded = [_trajectory(motion, path, names, config) for motion, path in zip(motions, paths, strict=True)]
    channels = [set(trajectory.channels) for trajectory in recorded]
    shared = [name for name in recorded[0].channels if all(name in one for one in channels)]
    trajectories = [replace(one, channels={name: one.channels[name] for name in shared}) for one in recorded]
    copies = [_perturbed(trajectories[0], config, number) for number in range(config.perturbed)]
    return Demonstrations(
        name=config.name,
        trajectories=(*trajectories, *copies),
        space=space_of(dict(trajectories[0].channels)),
        frame="laboratory, z up; the root of the model is at its hip",
        source=f"{', '.join(path.name for path in paths)}; {SOURCE}",
        licence="not stated in the file; see the database's own terms",
        steps=(_perturbation(config),) if copies else (),
        joint_names=names,
    )


def chosen_motion(path: Path, name: str | None) -> Motion:
    """The motion of this name; None for the only one that has joints.

    Raises:
        DatasetError: If none has joints, or several have.
        UnknownName: If there is no such motion.
    """
    motions = read_motions(path)
    if name is not None:
        found = [one for one in motions if one.name == name]
        if not found:
            raise UnknownName(f"motion of {path.name}", name, [one.name for one in motions])
    else:
        found = [one for one in motions if one.kinematic]
    names = ", ".join(repr(one.name) for one in found or motions)
    if len(found) > 1:
        raise DatasetError(path, f"has several motions with joints ({names}); choose one with dataset.motion=")
    if not found or not found[0].kinematic:
        raise DatasetError(path, f"has no joint positions in {names}; expected <JointPosition> in frames or sensors")
    return found[0]


def read_skeleton(config: MmmDataset, demonstrations: Demonstrations) -> Skeleton | None:
    """The model of the recorded person, as tall as it is [m]; None where no usable file of it is beside the recording.

    Raises:
        MissingData: If `dataset.skeleton` does not exist.
        DatasetError: If it is no model, has none of the recorded joints, or nothing says how tall the person is. Of a
            file that merely lies beside the recording, this is a warning.
    """
    recording = Path(config.path).expanduser()
    motion = chosen_motion(recording, config.motion)
    if config.skeleton is not None:
        return _skeleton(Path(config.skeleton).expanduser(), config, motion, demonstrations)
    names = [name for name in (Path(motion.model).name, *MODEL_FILES) if name not in ("", recording.name)]
    for path in (recording.with_name(name) for name in names if recording.with_name(name).is_file()):
        try:
            return _skeleton(path, config, motion, demonstrations)
        except DatasetError as error:
            _log.warning("%s: the person is not drawn by it", error)
    return None


def _skeleton(path: Path, config: MmmDataset, motion: Motion, demonstrations: Demonstrations) -> Skeleton:
    recording = Path(config.path).expanduser()
    height_m = config.height_m or motion.height_m
    if height_m is None:
        raise DatasetError(recording, "does not say how tall the person is; set dataset.height_m= to draw the skeleton")
    skeleton = read_simox(path, scale=height_m)
    known = skeleton.known(demonstrations.joint_names)
    if not known:
        raise DatasetError(path, f"has none of the recorded joints {', '.join(demonstrations.joint_names)}")
    if missing := [name for name in demonstrations.joint_names if name not in known]:
        _log.warning("%s lacks %s: they are learned, but not drawn", path.name, ", ".join(missing))
    return skeleton


def _joints(config: MmmDataset, paths: Sequence[Path], motions: Sequence[Motion]) -> tuple[str, ...]:
    """Names of the joints, in the order of the first recording, or as they are chosen."""
    known = [[name for series in motion.kinematic for name in series.joint_names] for motion in motions]
    if config.joints is not None:
        for path, names in zip(paths, known, strict=True):
            for name in config.joints:
                if name not in names:
                    raise UnknownName(f"joint of {path.name}", name, names)
        return tuple(config.joints)
    for path, names in zip(paths[1:], known[1:], strict=True):
        if set(names) != set(known[0]):
            lacking, extra = sorted(set(known[0]) - set(names)), sorted(set(names) - set(known[0]))
            raise DatasetError(
                path,
                f"its joints are not those of {paths[0].name}: it lacks {', '.join(lacking) or 'none'} and has "
                f"{', '.join(extra) or 'none'} beside them; choose common ones with dataset.joints=[…]",
            )
    return tuple(known[0])


def _trajectory(motion: Motion, path: Path, names: Sequence[str], config: MmmDataset) -> Trajectory:
    """Everything on the clock of the first sensor with joints, as far as all sensors reach."""
    series = [*motion.kinematic, *([] if motion.root is None else [motion.root])]
    for one in series:
        _refuse_gaps(one, path, motion.name)
    clock = motion.kinematic[0].time_s
    first, last = max(one.time_s[0] for one in series), min(one.time_s[-1] for one in series)
    time_s = clock[(clock >= first - SAME_TIME_S) & (clock <= last + SAME_TIME_S)]
    if len(time_s) < 2:
        spans = ", ".join(f"{one.what} from {one.time_s[0]:g} to {one.time_s[-1]:g} s" for one in series)
        raise DatasetError(path, f"motion {motion.name!r}: its sensors have less than two times in common: {spans}")
    columns = {
        name: _at(time_s, one.time_s, one.values[JOINTS][:, [column]])
        for one in motion.kinematic
        for column, name in enumerate(one.joint_names)
    }
    joints_rad = RADIANS_PER[config.angle_unit.value] * np.concatenate([columns[name] for name in names], axis=1)
    _refuse_degrees(joints_rad, names, path)
    channels = {"joints_rad": joints_rad}
    if motion.root is not None:
        channels |= _root(motion.root, time_s, path, config)
    label = path.stem if motion.name in path.stem else f"{path.stem} {motion.name}"
    return Trajectory(time_s, channels, label)


def _root(root: Series, time_s: Array, path: Path, config: MmmDataset) -> dict[str, Array]:
    position_m = METRES_PER[config.length_unit.value] * _at(time_s, root.time_s, root.values[POSITION])
    farthest_m = float(np.linalg.norm(position_m, axis=1).max())
    if farthest_m > 0 and not HEIGHTS_M[0] < farthest_m < HEIGHTS_M[1]:
        raise DatasetError(
            path,
            f"{POSITION} is at most {farthest_m:.3g} m from the origin, if it is given in {config.length_unit.value}; "
            f"expected {HEIGHTS_M[0]} to {HEIGHTS_M[1]:g} m for a person: set dataset.length_unit=",
        )
    if ROTATION not in root.values:
        raise DatasetError(path, f"{root.what}: <{POSITION}> without <{ROTATION}>; expected roll, pitch and yaw")
    angles_rad = RADIANS_PER[config.angle_unit.value] * root.values[ROTATION]
    rotation = _turned(time_s, root.time_s, roll_pitch_yaw(angles_rad))
    return {"position_m": position_m, "orientation_wxyz": rotation.as_quat(scalar_first=True)}


def roll_pitch_yaw(angles_rad: Array) -> "Rotation":
    """R = Rz(yaw) Ry(pitch) Rx(roll) of angles in this order, shape (time, 3), as Simox has it."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", angles_rad)  # lower case: about axes that are at rest


def _at(wanted_s: Array, time_s: Array, values: Array) -> Array:
    if len(wanted_s) == len(time_s) and np.abs(wanted_s - time_s).max() < SAME_TIME_S:
        return values
    return np.stack([np.interp(wanted_s, time_s, column) for column in values.T], axis=1)


def _turned(wanted_s: Array, time_s: Array, rotation: "Rotation") -> "Rotation":
    from scipy.spatial.transform import Slerp

    return Slerp(time_s, rotation)(np.clip(wanted_s, time_s[0], time_s[-1]))


def _refuse_gaps(series: Series, path: Path, motion: str) -> None:
    """Where frames are missing one after the other; single ones are left to the time stamps."""
    steps = np.diff(series.time_s)
    if not steps.size:
        raise DatasetError(path, f"motion {motion!r}: {series.what} has one frame; expected two or more")
    missing = np.round(steps / np.median(steps)) - 1
    worst = int(missing.argmax())
    if missing[worst] > LONGEST_GAP_FRAMES:
        raise DatasetError(
            path,
            f"motion {motion!r}, {series.what}: about {int(missing[worst])} frames are missing between frame {worst} "
            f"at {series.time_s[worst]:g} s and frame {worst + 1} at {series.time_s[worst + 1]:g} s; expected at most "
            f"{LONGEST_GAP_FRAMES} in a row",
        )


def _refuse_degrees(joints_rad: Array, names: Sequence[str], path: Path) -> None:
    frame, joint = map(int, np.unravel_index(np.abs(joints_rad).argmax(), joints_rad.shape))
    if abs(joints_rad[frame, joint]) > LARGEST_ANGLE_RAD:
        raise DatasetError(
            path,
            f"frame {frame}: {names[joint]} is {joints_rad[frame, joint]:.4g} rad, more than a whole turn; expected "
            "radians: set dataset.angle_unit=deg if these are degrees",
        )


def _perturbed(trajectory: Trajectory, config: MmmDataset, number: int) -> Trajectory:
    """A repetition that nobody made: smooth departures in all joints, and in the pose of the root."""
    from scipy.spatial.transform import Rotation

    way = (trajectory.time_s - trajectory.time_s[0]) / trajectory.duration_s
    generator = np.random.default_rng((config.seed, number))

    def departure(size: float, axes: int) -> Array:
        return wander(way, Spread(size, size, size), generator, axes)

    joints_rad = trajectory.channels["joints_rad"]
    channels = {"joints_rad": joints_rad + departure(config.perturbation_rad, joints_rad.shape[1])}
    if "position_m" in trajectory.channels:
        turn = Rotation.from_rotvec(departure(config.perturbation_rad, 3))
        rotation = turn * Rotation.from_quat(trajectory.channels["orientation_wxyz"], scalar_first=True)
        channels["position_m"] = trajectory.channels["position_m"] + departure(config.perturbation_m, 3)
        channels["orientation_wxyz"] = rotation.as_quat(scalar_first=True)
    return replace(trajectory, channels=channels, label=f"{trajectory.label}, perturbed {number}")


def _perturbation(config: MmmDataset) -> str:
    return (
        f"the last {config.perturbed} are copies of the first with smooth random departures, of standard deviation "
        f"{config.perturbation_rad:g} rad in joints and in the turn of the root, {config.perturbation_m:g} m in its "
        f"place; seed {config.seed}: not recorded"
    )
