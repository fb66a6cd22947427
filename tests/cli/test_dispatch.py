"""Finding the verb: help, version, hints, start-up time."""

import resource
import subprocess
import sys
from pathlib import Path

import pytest
from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from geomotion_cli.verbs import PROGRAMS

SCRIPTS = Path(sys.executable).parent
HEAVY = ("hydra", "matplotlib", "mlflow", "numpy", "omegaconf", "pandas", "torch")


def run(*words: str, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, capture_output=True, text=True, check=False, **options)


@pytest.mark.parametrize("program", PROGRAMS)
def test_help_takes_less_than_three_tenths_of_a_second_of_computing(program):
    def measure() -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert run(str(SCRIPTS / program), "--help").returncode == 0
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    assert min(measure() for _ in range(3)) < 0.3


def test_help_imports_nothing_heavy():
    script = "import sys; from geomotion_cli.dispatch import main; main('ncds', ['--help']); print(*sys.modules)"
    modules = set(run(sys.executable, "-c", script).stdout.split())
    assert "geomotion_cli.verbs" in modules
    assert not modules.intersection(HEAVY)


def test_help_of_a_verb_does_not_import_the_pipeline():
    script = "import sys; from geomotion_cli.dispatch import main; main('ncds', ['train', '-h']); print(*sys.modules)"
    modules = set(run(sys.executable, "-c", script).stdout.split())
    assert "hydra" in modules
    assert not modules.intersection({"matplotlib", "mlflow", "pandas", "torch"})


@pytest.mark.parametrize("program", PROGRAMS)
def test_help_lists_every_verb_with_its_summary(command, program):
    answer = command("--help", program=program)
    assert answer.status == 0
    for name, verb in PROGRAMS[program].verbs.items():
        assert f"  {name} " in answer.out
        assert verb.summary in answer.out


def test_every_verb_that_is_offered_exists():
    from geomotion.stages.gms_verbs import GMS
    from geomotion.stages.ncds_verbs import NCDS

    for program in (GMS, NCDS):
        assert set(PROGRAMS[program.name].verbs) == set(program.verbs) | {"ui"}


def test_without_a_verb_help_goes_to_standard_error(command):
    answer = command()
    assert (answer.status, answer.out) == (2, "")
    assert "Verbs:" in answer.err


@pytest.mark.parametrize("arguments", [("train", "--help"), ("help", "train"), ("train", "seed=1", "-h")])
def test_help_of_a_verb_shows_usage_settings_choices_flags_and_examples(command, arguments):
    answer = command(*arguments)
    assert answer.status == 0
    for part in (
        "Usage: ncds train",
        "training.steps=",
        "lasa/angle",
        "experiment = ",
        "thesis/ncds",
        "--cfg job",
        "-m",
    ):
        assert part in answer.out
    assert "_schema" not in answer.out


def test_gms_offers_no_settings_of_fields(command):
    assert "field" not in command("ingest", "--help", program="gms").out


SUGGESTIONS = {
    (program, suggestion)
    for program, entry in PROGRAMS.items()
    for verb in entry.verbs.values()
    for suggestion in (*verb.settings, *verb.examples)
}


@pytest.mark.parametrize(("program", "suggestion"), sorted(SUGGESTIONS))
def test_everything_that_the_help_suggests_is_accepted(command, program, suggestion):
    if suggestion.startswith("-m"):
        assert command("run", *suggestion.split(), program=program).status == 0
        return
    folder = ["dataset=folder"] if suggestion.startswith("dataset.root") else []
    with initialize_config_module(version_base="1.3", config_module="geomotion.conf"):
        OmegaConf.to_object(compose(program, overrides=[*folder, *suggestion.split()]))


@pytest.mark.parametrize(
    ("written", "meant"), [("trian", "train"), ("reports", "report"), ("evaluate", "eval"), ("chekc", "check")]
)
def test_an_unknown_verb_gets_a_hint(command, written, meant):
    answer = command(written, "dataset=lasa/angle")
    assert (answer.status, answer.out) == (2, "")
    assert f"unknown verb '{written}'. Did you mean '{meant}'?" in answer.err
    assert answer.err.count("\n") == 1


def test_a_setting_before_the_verb_is_explained(command):
    answer = command("seed=1", "train")
    assert answer.status == 2
    assert "comes before the verb" in answer.err


@pytest.mark.parametrize("arguments", [("--version",), ("train", "--version")])
def test_version(command, arguments):
    from geomotion import __version__

    assert command(*arguments).out == f"ncds {__version__}\n"


def test_the_module_runs_like_the_script():
    assert (
        run(sys.executable, "-m", "geomotion_cli", "gms", "--help").stdout == run(str(SCRIPTS / "gms"), "--help").stdout
    )
    assert run(sys.executable, "-m", "geomotion_cli", "gsm").returncode == 1


def test_a_reader_that_leaves_early_is_no_error():
    late = """
import select, sys
from geomotion_cli.dispatch import main
pipe = select.poll()
pipe.register(sys.stdout, 0)  # reports nothing but that the other end is closed
pipe.poll()
sys.exit(main("ncds", ["-h"]))
"""
    piped = run("bash", "-c", '"$0" -c "$1" | true; echo "${PIPESTATUS[0]}"', sys.executable, late)
    assert piped.stdout.strip() == "141"
    assert piped.stderr == ""
