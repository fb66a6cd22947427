"""Motions in the XML of the Master Motor Map (MMM), both layouts: root poses and joint positions over time.

The legacy layout has one ``MotionFrame`` after the other. The newer one has sensors, each with times of its own: of
those ``ModelPose`` and ``Kinematic`` are read, and all others left alone. Both give lengths in millimetres and angles
in radians, without saying so.

Source:
    MMM Data Format, legacy MMM Data Format, and MMM Sensor Plug-ins, https://mmm.humanoids.kit.edu.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from geomotion.demos.demonstrations import Array
from geomotion.errors import DatasetError
from geomotion.xml_files import read_xml

POSITION, ROTATION, JOINTS = "RootPosition", "RootRotation", "JointPosition"


@dataclass(frozen=True)
class Series:
    """Numbers over time, in the units of the file.

    Attributes:
        what: What to call it.
        time_s: Increasing, shape (frame,).
        values: Name of the XML element → numbers, each of shape (frame, number).
        joint_names: Of the columns of ``JointPosition``.
    """

    what: str
    time_s: Array
    values: dict[str, Array]
    joint_names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Motion:
    """One person, or thing, of a file.

    Attributes:
        name: As the file calls it.
        kinematic: Joint positions, one series for each sensor; none for rigid things.
        root: Where the model stands; None where the file does not say.
        height_m: Of the person, by which the model is scaled; None where the file does not say.
        model: File of the model, as the motion's file has it; empty where it does not say.
    """

    name: str
    kinematic: tuple[Series, ...]
    root: Series | None
    height_m: float | None
    model: str = ""


def read_motions(path: Path) -> tuple[Motion, ...]:
    """All motions of a file, in its order.

    Raises:
        MissingData: If there is no such file.
        DatasetError: If it is no MMM file, or breaks a rule; names motion, sensor and frame.
    """
    document = read_xml(path)
    if document.tag != "MMM":
        raise DatasetError(path, f"not an MMM motion: it begins with <{document.tag}>; expected <MMM>")
    motions = document.findall("Motion")
    if not motions:
        raise DatasetError(path, "holds no <Motion>")
    return tuple(_motion(one, path, number) for number, one in enumerate(motions))


def _motion(element: Element, path: Path, number: int) -> Motion:
    name = element.get("name") or f"motion {number}"
    place = f"motion {name!r}"
    series = _sensors(element, path, place) if element.find("Sensors") is not None else _legacy(element, path, place)
    kinematic = tuple(one for one in series if JOINTS in one.values)
    roots = [one for one in series if POSITION in one.values]
    if len(roots) > 1:
        raise DatasetError(path, f"{place} has {len(roots)} ModelPose sensors; expected one")
    _refuse_repeated([name for one in kinematic for name in one.joint_names], path, place)
    model = element.find("Model")
    file = "" if model is None else model.get("path") or model.findtext("File") or ""
    return Motion(name, kinematic, roots[0] if roots else None, _height(element, path, place), file.strip())


def _legacy(motion: Element, path: Path, place: str) -> list[Series]:
    frames = motion.findall("MotionFrames/MotionFrame")
    if not frames:
        return []
    names = _joint_names(motion.find("JointOrder"))
    has_joints = any(frame.find(JOINTS) is not None for frame in frames)
    if has_joints and not names:
        raise DatasetError(path, f"{place} has joint positions, but no <JointOrder> that names the joints")
    time_s = np.array([_time(frame.findtext("Timestep"), path, place, number) for number, frame in enumerate(frames)])
    tags = [tag for tag in (POSITION, ROTATION) if any(frame.find(tag) is not None for frame in frames)]
    values = _values(frames, tags, 3, path, place)
    whole = Series("frames", time_s, values | (_values(frames, [JOINTS], len(names), path, place) if names else {}))
    return [replace(_checked(whole, path, place), joint_names=names)]


def _sensors(motion: Element, path: Path, place: str) -> list[Series]:
    found = []
    for number, sensor in enumerate(motion.findall("Sensors/Sensor")):
        kind = sensor.get("type")
        what = f"{kind} sensor {sensor.get('name') or number}"
        frames = sensor.findall("Data/Measurement")
        if kind not in ("ModelPose", "Kinematic"):
            continue
        here = f"{place}, {what}"
        if not frames:
            raise DatasetError(path, f"{here} holds no <Measurement>")
        names = _joint_names(sensor.find("Configuration")) if kind == "Kinematic" else ()
        if kind == "Kinematic" and not names:
            raise DatasetError(path, f"{here} names no <Joint> in its <Configuration>")
        time_s = np.array([_time(frame.get("timestep"), path, here, index) for index, frame in enumerate(frames)])
        tags, width = ((JOINTS,), len(names)) if kind == "Kinematic" else ((POSITION, ROTATION), 3)
        series = Series(what, time_s, _values(frames, tags, width, path, here), names)
        found.append(_checked(series, path, here))
    return found


def _values(frames: Sequence[Element], tags: Sequence[str], width: int, path: Path, place: str) -> dict[str, Array]:
    return {
        tag: np.stack(
            [
                _numbers(frame.findtext(tag), width, path, f"{place}, frame {number}", tag)
                for number, frame in enumerate(frames)
            ]
        )
        for tag in tags
    }


def _numbers(text: str | None, width: int, path: Path, place: str, tag: str) -> Array:
    if text is None:
        raise DatasetError(path, f"{place} has no <{tag}>; expected {width} numbers")
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError as error:
        raise DatasetError(path, f"{place}: <{tag}> is not numbers ({error})") from error
    if len(values) != width:
        raise DatasetError(path, f"{place}: <{tag}> has {len(values)} numbers; expected {width}")
    if not np.isfinite(values).all():
        column = int(np.flatnonzero(~np.isfinite(values))[0])
        raise DatasetError(path, f"{place}: number {column} of <{tag}> is {values[column]}; expected finite numbers")
    return values


def _time(text: str | None, path: Path, place: str, number: int) -> float:
    if text is None:
        raise DatasetError(path, f"{place}, frame {number} has no time step")
    try:
        time_s = float(text)
    except ValueError:
        time_s = np.nan
    if not np.isfinite(time_s):
        raise DatasetError(path, f"{place}, frame {number}: the time step is {text.strip()!r}; expected seconds")
    return time_s


def _checked(series: Series, path: Path, place: str) -> Series:
    backwards = np.flatnonzero(np.diff(series.time_s) <= 0)
    if backwards.size:
        number = int(backwards[0]) + 1
        before, after = series.time_s[number - 1 : number + 1]
        raise DatasetError(
            path, f"{place}, frame {number}: time {after:g} s does not come after {before:g} s of the frame before"
        )
    return series


def _joint_names(parent: Element | None) -> tuple[str, ...]:
    return () if parent is None else tuple(joint.get("name", "") for joint in parent.findall("Joint"))


def _refuse_repeated(names: Sequence[str], path: Path, place: str) -> None:
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise DatasetError(path, f"{place} gives positions of {', '.join(map(repr, repeated))} more than once")


def _height(motion: Element, path: Path, place: str) -> float | None:
    text = motion.findtext("ModelProcessorConfig/Height") or motion.findtext("Model/ModelProcessorConfig/Height")
    if text is None:
        return None
    try:
        height_m = float(text)
    except ValueError:
        height_m = np.nan
    if not 0.3 < height_m < 3:
        raise DatasetError(path, f"{place}: the height of the person is {text.strip()!r}; expected metres")
    return height_m
