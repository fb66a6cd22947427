"""Take the pictures that conditions are learned from."""

from collections.abc import Mapping
from dataclasses import dataclass

from geomotion.config import GraspAndDropDataset, ManipulationSkill
from geomotion.demos import storage
from geomotion.demos.generators.grasp_and_drop_pictures import take
from geomotion.figures.snapshots import save_snapshots_figure
from geomotion.files import write_json
from geomotion.tracking import Artefacts, StageRun


@dataclass(frozen=True)
class SnapshotsConfig:
    """What the snapshots stage needs."""

    dataset: GraspAndDropDataset


def snapshots(config: SnapshotsConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``grasp.npz`` and ``drop.npz``, ``snapshots.json`` and ``figures/snapshots``."""
    demonstrations = storage.load(inputs["ingest"].folder)
    taken = {skill.value: take(config.dataset, skill, demonstrations) for skill in ManipulationSkill}
    document = {}
    for name, one in taken.items():
        path = run.folder / f"{name}.npz"
        one.save(path)
        document[name] = {
            "pictures": len(one),
            "height_px": one.pictures.shape[1],
            "width_px": one.pictures.shape[2],
            "mode": "RGB, 8 bits a channel",
            "of_places": int((one.place >= 0).sum()),
            "between": int((one.place < 0).sum()),
            "on_the_way": int(one.is_on_the_way.sum()),
            "bytes": path.stat().st_size,
        }
    write_json(run.folder / "snapshots.json", document)
    save_snapshots_figure(taken, run.folder / "figures")
