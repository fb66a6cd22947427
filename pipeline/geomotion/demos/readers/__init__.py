"""Readers: from files to :class:`~geomotion.demos.demonstrations.Demonstrations`, one module per source."""

from geomotion.config import (
    CoManipulationDataset,
    DatasetConfig,
    FolderDataset,
    GraspAndDropDataset,
    JCDataset,
    LasaDataset,
    LasaPoseDataset,
    LettersDataset,
    MmmDataset,
    PandaCircleJointDataset,
    PandaPouringDataset,
    PandaPouringJointDataset,
    PandaReachDataset,
    PandaReachJointDataset,
    PandaSinusoidDataset,
    PlanarSCurveDataset,
    RoboTasks9Dataset,
    RoboTasks9JointDataset,
    StraightLinesDataset,
)
from geomotion.demos.demonstrations import Demonstrations
from geomotion.demos.generators import (
    jc,
    letters,
    panda_grasp_and_drop,
    panda_joint,
    panda_pouring,
    panda_reach,
    panda_sinusoid,
    planar,
    straight_lines,
)
from geomotion.demos.readers import comanipulation, folder, lasa, lasa_pose, mmm, robotasks9, robotasks9_joint
from geomotion.robot.skeleton import Skeleton

__all__ = ["read", "read_skeleton"]


def read_skeleton(config: DatasetConfig, demonstrations: Demonstrations) -> Skeleton | None:
    """The body whose joints were recorded, in metres; None where there is none, or none is known.

    Raises:
        MissingData: If its file does not exist.
        DatasetError: If it cannot be read, or is not that of these demonstrations.
    """
    return mmm.read_skeleton(config, demonstrations) if isinstance(config, MmmDataset) else None


def read(config: DatasetConfig) -> Demonstrations:
    """The recordings that a configuration names, as the source gives them: no preprocessing, SI units.

    Raises:
        MissingData: If they are not on this machine and cannot be fetched; says how to get them.
        DatasetError: If they break a rule; names file, demonstration, row and rule.
    """
    match config:
        case LasaDataset():
            return lasa.read(config)
        case LasaPoseDataset():
            return lasa_pose.read(config)
        case CoManipulationDataset():
            return comanipulation.read(config)
        case RoboTasks9JointDataset():
            return robotasks9_joint.read(config)
        case RoboTasks9Dataset():
            return robotasks9.read(config)
        case MmmDataset():
            return mmm.read(config)
        case FolderDataset():
            return folder.read(config)
        case LettersDataset():
            return letters.generate(config)
        case JCDataset():
            return jc.generate(config)
        case StraightLinesDataset():
            return straight_lines.generate(config)
        case PandaReachDataset():
            return panda_reach.generate(config)
        case PandaPouringDataset():
            return panda_pouring.generate(config)
        case PandaSinusoidDataset():
            return panda_sinusoid.generate(config)
        case GraspAndDropDataset():
            return panda_grasp_and_drop.generate(config)
        case PandaReachJointDataset():
            return panda_joint.reach_to_grasp(config)
        case PandaPouringJointDataset():
            return panda_joint.pouring(config)
        case PandaCircleJointDataset():
            return panda_joint.circle(config)
        case PlanarSCurveDataset():
            return planar.generate(config)
        case _:
            raise TypeError(f"no reader for {type(config).__name__}")
