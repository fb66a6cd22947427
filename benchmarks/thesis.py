"""Every experiment of the thesis, one after the other, into docs/results.md.

Run as ``python benchmarks/thesis.py [--small] [--only NAME …] [--results FILE]``, or ``make thesis``, or ``make
thesis-small``. Each experiment is the command above its table, its output read by a program: finished stages are
reused, so that what was stopped goes on where it was. Its table replaces what stands between ``<!-- thesis/NAME -->``
and ``<!-- end -->`` in the file; the text around is written by people. Human motion is not fetched by itself and has to
be named by ``--mmm``, or its experiments are left out, and listed.
Exits with 1 if one failed.
"""

import argparse
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import partial
from pathlib import Path
from typing import Any

from geomotion.files import write_text
from geomotion.stages.episodes import EPISODE_COLUMNS, episode_rows
from geomotion.stages.plan import plan_table
from geomotion.stages.policy_replay import policy_replay_table
from geomotion.stages.replay import replay_table
from geomotion.stages.study_table import markdown_table
from geomotion.tables import markdown, number

LEFT_OUT = "left out: name its recordings with --mmm"
NO_MOTION = 3  # exit status of a plan or replay that found no way, which some figures are about
SMALL_FIELD = ("training.steps=20", "evaluation.contraction_grid_points=5", "evaluation.region_starts=4")
SMALL_STUDY = (*SMALL_FIELD, "study.seeds=[0]")
SMALL_PICTURES = (
    "dataset.demos=1", "dataset.points=60", "dataset.snapshots=4", "training.steps=20", "episodes.per_place=1",
    "episodes.between=0",
)  # fmt: skip
SMALL_MANIFOLD = (
    "training.steps=300", "training.spread_steps=60", "training.restarts=0", "training.batch_points=256",
    "graph.points_per_axis=60", "manifold.points=60", "manifold.kernels=100",
)  # fmt: skip


@dataclass(frozen=True)
class Experiment:
    """One experiment.

    Attributes:
        name: Its file in conf/experiment/thesis.
        scores: Patterns of the scores to show; a study has columns of its own.
        small: Settings of the toy size.
        program: Which one runs it.
        human_motion: Whether it needs ``--mmm``.
    """

    name: str
    scores: tuple[str, ...] = ()
    small: tuple[str, ...] = SMALL_STUDY
    program: str = "ncds"
    human_motion: bool = False


def _gms(name: str, *scores: str, small: tuple[str, ...] = ()) -> Experiment:
    return Experiment(name, scores, (*SMALL_MANIFOLD, *small), "gms")


FIT = ("train.dtwd_per_point", "heldout.dtwd_per_point", "contraction.*.non_contracting_fraction")
FOLLOWED = (
    "train.dtwd_per_point", "train.*ion_dtwd", "heldout.dtwd_per_point", "heldout.*ion_dtwd", "pushes.*", "obstacles.*",
)  # fmt: skip
PLANNED = ("heldout.planned_share", "pairs.planned_share", "heldout.*_dtwd_ratio", "heldout.*_ratio_of_averaged_demo")
EXPERIMENTS = (
    _gms("fig_3_1", *PLANNED, small=("dataset.demos=6",)),
    _gms("fig_3_3", "methods.*", *PLANNED, small=("dataset.demos=6",)),
    _gms("fig_3_6", *PLANNED),
    _gms("fig_3_7", *PLANNED),
    _gms("fig_3_8", *PLANNED, small=("dataset.demos=12", "dataset.points=60")),
    _gms("fig_3_9", *PLANNED, small=("dataset.demos=12", "dataset.points=60")),
    _gms("fig_4_1", *PLANNED),
    _gms("fig_4_3", *PLANNED),
    _gms("fig_4_4", "arm_failures.*", *PLANNED),
    _gms("fig_4_5", "heldout.group_switches", "heldout.jerk", *PLANNED, small=("graph.points_per_axis=20",)),
    _gms("fig_4_7a", *PLANNED, small=("graph.points_per_axis=20",)),
    _gms("fig_4_7b", *PLANNED, small=("graph.points_per_axis=20",)),
    _gms("fig_4_7c", *PLANNED, small=("graph.points_per_axis=20",)),
    _gms("fig_4_8", *PLANNED, small=("graph.points_per_axis=20",)),
    _gms("fig_4_9", *PLANNED, small=("graph.points_per_axis=20",)),
    Experiment("table_5_1"),
    Experiment("table_5_2", small=(*SMALL_STUDY, "study.datasets=[lasa/angle]")),
    Experiment("table_5_3", small=(*SMALL_STUDY, "study.datasets=[lasa/sine]")),
    Experiment("fig_5_7", (*FIT, "obstacles.*"), SMALL_FIELD),
    Experiment("fig_5_8ab", ("*.dtwd_ratio*", "*.dtwd_per_point", "*.never_reached"), SMALL_FIELD),
    Experiment("fig_5_8cd", ("*.dtwd_ratio*", "*.dtwd_per_point", "*.never_reached"), SMALL_FIELD),
    Experiment("fig_5_10"),
    Experiment("fig_5_11"),
    Experiment("fig_5_12"),
    Experiment("fig_5_13"),
    Experiment("table_6_2", small=(*SMALL_STUDY, "study.datasets=[lasa/angle]")),
    Experiment("table_6_3", small=("training.steps=5", "study.datasets=[lasa/angle]")),
    Experiment("fig_6_5", ("safety.*",), (*SMALL_FIELD, "safety.starts=50", "safety.points_per_axis=120")),
    Experiment("fig_6_6", small=(*SMALL_STUDY, "study.datasets=[lasa/angle]")),
    Experiment("fig_6_8", small=(*SMALL_STUDY, "study.datasets=[lasa/angle]")),
    Experiment("fig_6_10", small=(*SMALL_STUDY, "evaluation.timed_steps=3")),
    Experiment("fig_6_13a", FOLLOWED, SMALL_FIELD),
    Experiment("fig_6_13b", FOLLOWED, SMALL_FIELD),
    Experiment("fig_6_13c", FOLLOWED, SMALL_FIELD),
    Experiment("fig_6_13d", FOLLOWED, SMALL_FIELD),
    Experiment("fig_6_14", ("train.joint_rmse*", "returns.*"), SMALL_FIELD, human_motion=True),
    Experiment("fig_6_15", ("train.joint_rmse*", "returns.*"), SMALL_FIELD, human_motion=True),
    Experiment("fig_6_16", small=SMALL_PICTURES),
    Experiment("fig_6_17", ("safety.*",), (*SMALL_FIELD, "safety.starts=50")),
)


@dataclass(frozen=True)
class Outcome:
    """What became of an experiment: its table, and what went wrong; without a table, why there is none."""

    table: str | None
    failure: str | None = None


def main() -> int:
    """Run, write, report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--small", action="store_true", help="toy size: whether everything runs, in minutes")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these alone, such as table_5_1")
    parser.add_argument("--results", type=Path, help="file whose tables are replaced; without it they are printed")
    parser.add_argument("--jobs", type=int, default=1, help="experiments at once")
    parser.add_argument("--root", default="runs", help="results folder")
    parser.add_argument("--mmm", help="file of a human motion in MMM XML")
    parser.add_argument("overrides", nargs="*", help="further settings for every experiment")
    asked = parser.parse_args()
    if unknown := set(asked.only or ()) - {one.name for one in EXPERIMENTS}:
        parser.error(f"no experiment {', '.join(sorted(unknown))}; there are {', '.join(e.name for e in EXPERIMENTS)}")
    if asked.results is not None and not asked.results.is_file():
        parser.error(f"no file {asked.results} whose tables could be replaced")
    failed = []
    wanted = [one for one in EXPERIMENTS if not asked.only or one.name in asked.only]
    pool = ThreadPoolExecutor(asked.jobs)
    for experiment, outcome in zip(wanted, pool.map(partial(run, asked=asked), wanted), strict=True):
        if outcome.failure is not None:
            print(f"{experiment.name}: {outcome.failure}", file=sys.stderr, flush=True)
            failed += [] if outcome.failure == LEFT_OUT else [experiment.name]
        if outcome.table is None:
            continue
        if asked.results is None:
            print(f"{outcome.table}\n", flush=True)
        else:
            write_text(asked.results, with_table(asked.results.read_text("utf-8"), experiment.name, outcome.table))
            print(f"{experiment.name}: done", file=sys.stderr, flush=True)
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def run(experiment: Experiment, asked: argparse.Namespace) -> Outcome:
    """Carry out the command of an experiment and read what it says."""
    typed = [f"experiment=thesis/{experiment.name}", *(experiment.small if asked.small else ()), *asked.overrides]
    hidden = [f"tracking.root={asked.root}", "output=json"]
    if experiment.human_motion:
        if asked.mmm is None:
            return Outcome(None, LEFT_OUT)
        hidden.append(f"dataset.path={asked.mmm}")
    command = [sys.executable, "-m", "geomotion_cli", experiment.program, "run", *typed, *hidden]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    said = process.stdout.read()
    _, status, used = os.wait4(process.pid, 0)
    exit_code = os.waitstatus_to_exitcode(status)
    failure = None if exit_code in (0, NO_MOTION) else f"failed with exit status {exit_code}"
    document = json.loads(said) if said.strip() else {}
    if failure is not None and "study" not in document:  # the table of a study stands though some cells failed
        return Outcome(None, failure)
    seconds = used.ru_utime + used.ru_stime
    shown = shlex.join([experiment.program, "run", *typed])
    found = "\n".join(tables(document, experiment.scores))
    return Outcome(f"`{shown}`, {seconds:.0f} s of CPU (less where stages were reused)\n\n{found}", failure)


def tables(document: dict[str, Any], patterns: Sequence[str]) -> Iterator[str]:
    """Markdown of a study, of episodes in closed loop, or of the wanted scores of one run."""
    if "study" in document:
        yield markdown_table(document["study"]).strip()
        return
    if "episodes" in document:
        yield markdown([EPISODE_COLUMNS, *episode_rows(document["episodes"])])
        return
    rows = [("score", "value", "unit", "of")]
    for name, score in document.get("scores", {"scores": {}})["scores"].items():
        if any(fnmatch(name, pattern) for pattern in patterns):
            value = number(score["value"], score["spread"] if score["statistic"] == "mean" else None)
            rows.append((name, value, "" if score["unit"] == "1" else score["unit"], f"{score['count']}"))
    if len(rows) > 1:
        yield markdown(rows)
    if "certificate" in document:
        certificate = document["certificate"]
        rate = certificate["rate_per_s"]
        proven = "" if rate is None else f", at {rate:.3g} 1/s"
        yield f"\nContraction: {certificate['claim'].replace('_', ' ')}{proven}."
    if "plan" in document:
        yield _as_printed(plan_table(document["plan"]))
    if "replay" in document:
        told = replay_table if "plan" in document else policy_replay_table
        yield _as_printed(told(document["replay"]))


def _as_printed(lines: str) -> str:
    return f"\n```\n{lines}\n```"


def with_table(text: str, name: str, table: str) -> str:
    """A page with one table replaced, or added at its end."""
    begin, end = f"<!-- thesis/{name} -->", "<!-- end -->"
    block = f"{begin}\n{table}\n{end}"
    pattern = re.compile(re.escape(begin) + r"\n.*?\n" + re.escape(end), re.DOTALL)
    if pattern.search(text):
        return pattern.sub(lambda _: block, text, count=1)
    return f"{text.rstrip()}\n\n### thesis/{name}\n\n{block}\n"


if __name__ == "__main__":
    sys.exit(main())
