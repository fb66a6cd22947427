"""Stage ``ingest``: recordings in, preprocessed demonstrations out, with a summary and a picture."""

from collections.abc import Mapping

from geomotion.config import DatasetConfig
from geomotion.demos import readers, storage
from geomotion.demos.orientations import check_orientations
from geomotion.demos.preprocessing import preprocess
from geomotion.demos.selection import split, state_channels
from geomotion.demos.summary import summarise, summary_table
from geomotion.figures.demonstrations import figure_data, figure_demonstrations
from geomotion.figures.style import save_figure
from geomotion.files import write_json
from geomotion.tracking import Artefacts, StageRun

__all__ = ["ingest", "summary_table"]

SKELETON = "skeleton.json"


def ingest(config: DatasetConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Read and preprocess the demonstrations that `config` names.

    Writes the dataset in the layout of :mod:`geomotion.demos.storage`, ``summary.json`` (what
    :func:`summary_table` prints) and ``figures/demonstrations``; where a body was recorded whose model is at hand, also
    ``skeleton.json``.

    Raises:
        MissingData: If the recordings are not there.
        DatasetError: If they break a rule.
        InvalidSetting: If the configuration does not fit them.
    """
    recorded = readers.read(config)
    check_orientations(recorded)
    demonstrations = preprocess(recorded, config.preprocess)
    state_channels(config, demonstrations)  # refuses wrong ones before anything is written
    _, held_out = split(config, demonstrations)
    digest = storage.save(demonstrations, run.folder)
    run.log_dataset(demonstrations.name, digest, demonstrations.source)
    write_json(run.folder / "summary.json", summarise(demonstrations, config))
    skeleton = readers.read_skeleton(config, demonstrations)
    if skeleton is not None:
        write_json(run.folder / SKELETON, {"nodes": skeleton.document()})
    figure = figure_demonstrations(demonstrations, held_out=held_out)
    save_figure(figure, run.folder / "figures", "demonstrations", figure_data(demonstrations))
