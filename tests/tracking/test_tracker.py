import multiprocessing
import shutil
import signal
from pathlib import Path

import pytest

from geomotion.config import TrackingConfig
from geomotion.errors import (
    CorruptArtefact,
    DiskFull,
    Interrupted,
    MissingArtefact,
    MissingData,
    MissingRun,
    StoreUnavailable,
)
from geomotion.files import atomic
from geomotion.tracking import Artefacts, Stage, Tracker, store
from geomotion.tracking.artefacts import digest_of, run_key


@pytest.fixture
def config(fresh_store) -> TrackingConfig:
    return TrackingConfig(root=str(fresh_store))


class Counting:
    """A stage that counts its executions and writes its configuration."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, config, inputs, run) -> None:
        self.calls += 1
        text = str(config) + "".join(found.path("value.txt").read_text() for found in inputs.values())
        (run.folder / "value.txt").write_text(text)
        run.log_series(1, {"loss": 0.5})


def execute(config, stage, settings, inputs=None, reuse=True):
    tracker = Tracker(config, reuse)
    with tracker.command("ncds test", settings, []) as command:
        return tracker.run_stage(stage, settings, inputs or {}, command)


def test_a_finished_stage_with_the_same_key_is_reused(config):
    work = Counting()
    first = execute(config, Stage("train", work), {"steps": 1})
    second = execute(config, Stage("train", work), {"steps": 1})
    assert first == second
    assert work.calls == 1
    assert first.path("value.txt").read_text() == "{'steps': 1}"


def test_another_configuration_or_input_or_reuse_false_repeats_the_stage(config):
    work = Counting()
    stage = Stage("train", work)
    first = execute(config, stage, {"steps": 1})
    execute(config, stage, {"steps": 2})
    execute(config, stage, {"steps": 1}, {"ingest": first})
    execute(config, stage, {"steps": 1}, reuse=False)
    assert work.calls == 4


def test_a_stage_that_reads_outside_is_repeated_but_kept_once(config):
    work = Counting()
    stage = Stage("ingest", work, reads_outside=True)
    first, second = execute(config, stage, {}), execute(config, stage, {})
    assert work.calls == 2
    assert first.run_id == second.run_id


class TestMerging:
    def test_what_another_folder_finished_is_taken_over_with_its_curves(self, config, tmp_path):
        elsewhere, here = Counting(), Counting()
        done = execute(config, Stage("train", elsewhere), {"seed": 1})
        moved = tmp_path / "from another machine"
        shutil.move(config.root, moved)
        own = TrackingConfig(root=str(tmp_path / "own"), merge=[str(moved)])
        found = execute(own, Stage("train", here), {"seed": 1})
        assert (elsewhere.calls, here.calls) == (1, 0)
        assert found.run_id != done.run_id and found.digest == done.digest
        assert found.path("value.txt").read_text() == str({"seed": 1})
        client = Tracker(own).client
        assert [point.value for point in client.get_metric_history(found.run_id, "loss")] == [0.5]
        assert execute(own, Stage("train", here), {"seed": 1}).run_id == found.run_id
        execute(own, Stage("train", here), {"seed": 2})
        assert here.calls == 1
        execute(own, Stage("train", here), {"seed": 1}, reuse=False)
        assert here.calls == 2

    def test_a_folder_without_results_is_named(self, tmp_path):
        with pytest.raises(MissingData, match=r"tracking\.merge"):
            Tracker(TrackingConfig(root=str(tmp_path / "own"), merge=[str(tmp_path / "none")]))


def test_the_key_depends_on_configuration_and_inputs_only():
    assert run_key("train", {"a": 1, "b": 2}, {}) == run_key("train", {"b": 2, "a": 1}, {})
    assert run_key("train", {"a": 1}, {}) != run_key("train", {"a": 2}, {})
    assert run_key("train", {"a": 1}, {}) != run_key("evaluate", {"a": 1}, {})


def test_a_changed_file_is_noticed_before_it_is_used(config):
    first = execute(config, Stage("ingest", Counting()), {})
    (first.folder / "value.txt").write_text("tampered")
    with pytest.raises(CorruptArtefact, match="ingest"):
        execute(config, Stage("train", Counting()), {}, {"ingest": first})


def test_pictures_and_records_do_not_count_in_the_digest(tmp_path):
    (tmp_path / "model.pt").write_text("weights")
    before = digest_of(tmp_path)
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "a.pdf").write_text("today's date")
    assert digest_of(tmp_path) == before
    (tmp_path / "model.pt").write_text("other weights")
    assert digest_of(tmp_path) != before


def test_a_failing_stage_marks_both_runs_failed_and_leaves_no_artefacts(config):
    def fail(settings, inputs, run):
        (run.folder / "half.txt").write_text("half")
        raise ValueError("broken")

    with pytest.raises(ValueError, match="broken"):
        execute(config, Stage("train", fail), {})
    tracker = Tracker(config)
    runs = tracker.client.search_runs([tracker.experiment_id])
    assert {run.info.status for run in runs} == {"FAILED"}
    assert all("broken" in run.data.tags["geomotion.error"] for run in runs)
    assert not list(Path(config.root).rglob("half.txt"))


def test_a_stopped_stage_is_marked_killed_and_continued_in_the_same_run(config):
    def stop(settings, inputs, run):
        with atomic(run.checkpoint) as temporary:
            temporary.write_text("halfway")
            killed_while_written = temporary.with_stem(f"{temporary.stem}0")
            killed_while_written.write_text("half of it")
        raise Interrupted(signal.SIGTERM, "again")

    def resume(settings, inputs, run):
        (run.folder / "value.txt").write_text(run.checkpoint.read_text() + " and done")

    with pytest.raises(Interrupted):
        execute(config, Stage("train", stop), {})
    tracker = Tracker(config)
    stopped = tracker.client.search_runs([tracker.experiment_id], "tags.`geomotion.stage` = 'train'")
    assert [run.info.status for run in stopped] == ["KILLED"]
    finished = execute(config, Stage("train", resume), {})
    assert finished.run_id == stopped[0].info.run_id
    assert finished.path("value.txt").read_text() == "halfway and done"
    assert not list((Path(config.root) / "work").glob("*.checkpoint"))  # hidden files, too


def test_what_was_logged_before_a_failure_is_kept(config):
    def diverge(settings, inputs, run):
        run.log_series(1, {"loss": 0.5})
        raise ValueError("infinite")

    with pytest.raises(ValueError, match="infinite"):
        execute(config, Stage("train", diverge), {})
    tracker = Tracker(config)
    (run,) = tracker.client.search_runs([tracker.experiment_id], "tags.`geomotion.stage` = 'train'")
    assert run.data.metrics == {"loss": 0.5}


def test_a_stage_begins_in_an_empty_folder_even_after_a_killed_process(config):
    def remember(settings, inputs, run):
        found.append(sorted(path.name for path in run.folder.iterdir()))

    found = []
    left_behind = Path(config.root) / "work" / f"{run_key('train', {}, {})}.outputs"
    left_behind.mkdir(parents=True)
    (left_behind / "half.txt").write_text("half")
    execute(config, Stage("train", remember), {})
    assert found == [["config.json", "environment.json"]]
    assert not left_behind.exists()


def test_a_database_error_inside_a_stage_is_one_of_the_store(config):
    def log(settings, inputs, run):
        run.log_series(0, {"not a name?*": 1.0})

    with pytest.raises(StoreUnavailable, match="Invalid"), store.database_errors("sqlite:///here"):
        execute(config, Stage("train", log), {})


def test_a_full_disk_fails_the_stage_with_one_clear_error(config, monkeypatch):
    def write(settings, inputs, run):
        with atomic(run.folder / "model.pt") as temporary:
            temporary.write_bytes(b"x")
            raise OSError(28, "No space left on device")

    with pytest.raises(DiskFull, match="no space left while writing"):
        execute(config, Stage("train", write), {})


class TestLineage:
    def test_latest_and_run_ids_and_paths_name_the_same_stages(self, config):
        ingested = execute(config, Stage("ingest", Counting()), {})
        trained = execute(config, Stage("train", Counting()), {}, {"ingest": ingested})
        tracker = Tracker(config)
        for name in (
            "latest",
            trained.run_id,
            trained.run_id[:8],
            str(trained.folder),
            str(trained.folder / "value.txt"),
        ):
            assert tracker.lineage(name) == {"ingest": ingested, "train": trained}

    def test_a_repetition_that_found_nothing_new_leads_to_what_was_kept(self, config):
        stage = Stage("ingest", Counting(), reads_outside=True)
        first = execute(config, stage, {})
        execute(config, stage, {})
        tracker = Tracker(config)
        runs = tracker.client.search_runs([tracker.experiment_id], "tags.`geomotion.stage` = 'ingest'")
        assert len(runs) == 2
        for run in runs:
            assert tracker.lineage(run.info.run_id) == {"ingest": first}

    def test_a_command_inside_another_keeps_its_own_settings(self, config):
        tracker = Tracker(config)
        with (
            tracker.command("ncds run", {}, ["study"]) as outer,
            tracker.command("ncds eval", {}, ["cell"], outer) as inner,
        ):
            stage = tracker.run_stage(Stage("train", Counting()), {}, {}, inner)
        assert [tracker.overrides(run) for run in (outer.run_id, inner.run_id, stage.run_id)] == [
            ["study"], ["cell"], ["cell"],
        ]  # fmt: skip
        assert tracker.client.get_run(inner.run_id).data.tags["mlflow.parentRunId"] == outer.run_id

    def test_missing_runs_are_reported(self, config):
        tracker = Tracker(config)
        with pytest.raises(MissingRun, match="no finished training"):
            tracker.lineage("latest")
        with pytest.raises(MissingRun, match="no such run"):
            tracker.lineage("deadbeef")
        with pytest.raises(MissingRun, match="not inside the artefacts"):
            tracker.lineage("/tmp")

    def test_a_missing_file_names_the_stage_to_repeat(self, config):
        with pytest.raises(MissingArtefact, match="ncds train reuse=false"):
            execute(config, Stage("train", Counting()), {}).path("model.pt")
        with pytest.raises(MissingArtefact, match="gms eval reuse=false"):
            Artefacts("evaluate", "0", Path(config.root), "", "gms").path("scores.json")


class TestStore:
    def test_a_file_that_is_no_database_is_reported(self, tmp_path):
        (tmp_path / "mlflow.db").write_text("this is not SQLite " * 100)
        with pytest.raises(StoreUnavailable, match="not an SQLite database"):
            Tracker(TrackingConfig(root=str(tmp_path)))

    def test_a_root_that_cannot_be_a_folder_is_reported(self, tmp_path):
        (tmp_path / "file").write_text("")
        with pytest.raises(StoreUnavailable):
            Tracker(TrackingConfig(root=str(tmp_path / "file" / "runs")))

    def test_two_processes_create_a_fresh_store_at_the_same_time(self, tmp_path):
        context = multiprocessing.get_context("spawn")
        processes = [context.Process(target=_use_store, args=(str(tmp_path),)) for _ in range(2)]
        for process in processes:
            process.start()
        for process in processes:
            process.join(120)
        assert [process.exitcode for process in processes] == [0, 0]
        tracker = Tracker(TrackingConfig(root=str(tmp_path)))
        runs = tracker.client.search_runs([tracker.experiment_id], "tags.`geomotion.stage` = 'train'")
        assert [run.info.status for run in runs] == ["FINISHED"]


def _use_store(root: str) -> None:
    execute(TrackingConfig(root=root), Stage("train", Counting()), {})
