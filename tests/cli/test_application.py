"""One verb from the command line to the result: streams, errors, exit statuses, sweeps."""

import json
import signal
import subprocess
import sys

import pytest
from hydra._internal.core_plugins import basic_launcher


def error_lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if "error" in line.lower()]


def test_text_goes_to_standard_output_and_noise_to_standard_error(command):
    answer = command("train")
    assert (answer.status, answer.out) == (0, "done train\n")
    for noise in ("printed noise", "noise from C", "noise from a child"):
        assert noise in answer.err


def test_json_is_one_document_alone_on_standard_output(command):
    answer = command("train", "output=json", "chart.layers=4")
    assert answer.status == 0
    assert json.loads(answer.out) == {
        "verb": "train",
        "config": "NcdsConfig",
        "overrides": ["output=json", "chart.layers=4"],
    }


def test_gms_gets_its_own_configuration(command):
    assert json.loads(command("ingest", "output=json", program="gms").out)["config"] == "GmsConfig"


def test_nothing_is_written_outside_the_tracking_root(command, tmp_path):
    command("train", "tracking.root=kept")
    command("train", "-m", "seed=0,7", "tracking.root=kept")
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]
    assert not list(tmp_path.rglob("*.log"))


@pytest.mark.parametrize(
    ("seed", "status", "kind", "message"),
    [
        (101, 1, "MissingRun", "run=lost: there is no such run"),
        (102, 70, "RuntimeError", "internal error: RuntimeError: two lines (repeat with --debug"),
        (103, 143, "Interrupted", "stopped by signal 15"),
        (106, 70, "ValueError", "internal error: ValueError: Out of range float"),
    ],
)
def test_a_failure_is_one_line_a_status_and_a_document(command, seed, status, kind, message):
    answer = command("train", f"seed={seed}", "output=json")
    assert answer.status == status
    (line,) = error_lines(answer.err)
    assert line.startswith(f"ncds train: error: {message}")
    error = json.loads(answer.out)["error"]
    assert error["type"] == kind
    assert error["message"].startswith(message)


def test_text_output_says_errors_on_standard_error_only(command):
    assert command("train", "seed=101").out == ""


def test_debug_shows_where_it_happened(command):
    assert "Traceback" not in command("train", "seed=102").err
    assert "in run_verb" in command("train", "seed=102", "--debug").err


def test_a_result_may_carry_a_status_of_its_own(command):
    answer = command("check", "seed=104")
    assert (answer.status, answer.out) == (1, "worse\n")
    assert not error_lines(answer.err)


def test_ctrl_c_outside_of_the_pipelines_care_shows_no_traceback(command):
    answer = command("train", "seed=105")
    assert answer.status == 130
    assert answer.err.endswith("ncds: stopped.\n")
    assert "Traceback" not in answer.err


def test_ctrl_c_while_libraries_are_imported_ends_the_process_at_once(tmp_path):
    script = """
import os, signal, sys
from geomotion_cli.dispatch import main
class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == "geomotion.stages":
            try:
                os.kill(os.getpid(), signal.SIGINT)
            except KeyboardInterrupt:
                raise ImportError("half-imported")
sys.meta_path.insert(0, Interrupting())
main("ncds", ["train"])
"""
    ended = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (-signal.SIGINT, "", "")


def test_a_sweep_runs_every_job_and_returns_their_objectives(command, monkeypatch):
    returns = []

    def run_job(*arguments, **options):
        returns.append(true_run_job(*arguments, **options))
        return returns[-1]

    true_run_job = basic_launcher.run_job
    monkeypatch.setattr(basic_launcher, "run_job", run_job)
    answer = command("train", "-m", "seed=0,7", "chart.layers=3,4")
    assert (answer.status, answer.out) == (0, "done train\n" * 4)
    assert [job.return_value for job in returns] == [0.25] * 4


@pytest.mark.parametrize("launcher", ["basic", "joblib"])
def test_a_sweep_goes_on_after_a_failing_job_and_fails_in_the_end(command, launcher):
    pytest.importorskip("hydra_plugins.hydra_joblib_launcher")
    workers = ["hydra.launcher.n_jobs=2"] if launcher == "joblib" else []
    answer = command("train", "-m", "seed=0,101,7", "output=json", f"hydra/launcher={launcher}", *workers)
    assert answer.status == 1
    (line,) = error_lines(answer.err)
    assert line.startswith("ncds train seed=101 output=json: error: run=lost")
    documents = [json.loads(line) for line in answer.out.splitlines()]
    assert sorted(document.get("verb", "failed") for document in documents) == ["failed", "train", "train"]


def test_an_interruption_ends_the_whole_sweep(command):
    answer = command("train", "-m", "seed=103,0")
    assert (answer.status, answer.out) == (143, "")


def test_cfg_shows_the_configuration_without_running(command):
    answer = command("train", "--cfg", "job", "chart.layers=7")
    assert answer.status == 0
    assert "layers: 7" in answer.out
    assert "done" not in answer.out


def test_info_shows_where_settings_come_from(command):
    answer = command("train", "--info", "searchpath")
    assert answer.status == 0
    assert "pkg://geomotion.conf" in answer.out


def test_a_folder_that_cannot_be_made_is_named(command, tmp_path):
    (tmp_path / "file").touch()
    answer = command("train", "tracking.root=file")
    assert answer.status == 1
    assert (
        answer.err
        == "ncds train: error: cannot write file/hydra: Not a directory. Set tracking.root= to another folder.\n"
    )
