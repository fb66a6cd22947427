"""What the two programs can do: one entry per verb, shown by every help text and completed by the shell.

Standard library only: the dispatcher reads this table before anything heavy is imported.
"""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Verb:
    """One sub-command."""

    summary: str
    settings: dict[str, str] = field(default_factory=dict)  # the overrides asked for most often, and what they do
    examples: tuple[str, ...] = ()  # what follows the verb


@dataclass(frozen=True)
class Program:
    """One command with its verbs."""

    summary: str
    verbs: dict[str, Verb]


_DATASET = {"dataset=letters/j": "recordings to use; every choice is listed below"}
_MODEL = {
    "field=linear": "contracting by construction, in the coordinates of a learned flow",
    "field=potential": "the same with a nonlinear time law",
    "field=line_integral": "the thesis' field, contraction measured only",
}
_TRAINING = {
    "training.steps=4000": "optimiser steps",
    "seed=0": "the same seed, data and machine give the same result",
    "reuse=false": "repeat even what a finished run with equal settings already holds",
}
_RUN = {"run=latest": "the trained run: latest, an MLflow run id, or a path"}
_STORE = {"tracking.root=runs": "folder of the MLflow store, artefacts and checkpoints"}
_JSON = {"output=json": "one JSON document (a sweep: one line per job) on standard output, all else on standard error"}

_INGEST = Verb(
    "read, check and preprocess recordings; print a table and draw them",
    {
        **_DATASET,
        "dataset.root=PATH": "folder of your own recordings, with dataset=folder",
        "dataset.preprocess.resample_points=200": "points per demonstration; null keeps the recorded ones",
        **_JSON,
    },
    ("dataset=lasa/angle", "dataset=folder dataset.root=my_recordings"),
)
_UI = Verb("open the MLflow pages of the local store", _STORE, ("", "tracking.root=elsewhere/runs"))

PROGRAMS = {
    "gms": Program(
        "Geodesic motion skills: recordings of demonstrations, for now.",
        {"ingest": _INGEST, "ui": _UI},
    ),
    "ncds": Program(
        "Neural contractive dynamical systems: vector fields learned from a handful of demonstrations.",
        {
            "run": Verb(
                "the whole chain: ingest, train, rollout, eval, report",
                {**_DATASET, **_MODEL, "experiment=thesis/ncds": "the thesis' own settings", **_TRAINING, **_JSON},
                (
                    "dataset=lasa/angle",
                    "dataset=lasa/angle field=line_integral",
                    "-m dataset=letters/c,letters/s seed=0,1",
                ),
            ),
            "ingest": _INGEST,
            "train": Verb(
                "fit a vector field to demonstrations; continues where an interrupted training stopped",
                {**_DATASET, **_MODEL, **_TRAINING, "chart.layers=10": "depth of the flow", **_JSON},
                ("dataset=lasa/sine", "dataset=lasa/sine training.steps=3000 seed=1", "-m chart.layers=6,10,14"),
            ),
            "rollout": Verb(
                "follow a trained field from given starts",
                {
                    **_RUN,
                    "rollout.demos=[0,1]": "from the first point of these demonstrations",
                    "rollout.starts_m=[[0.1,0.05]]": "or from these points [m]",
                    "rollout.duration_s=5.0": "how long [s]",
                    "obstacle=sphere obstacle.centre_m=[0.1,0] obstacle.radius_m=0.01": "around an obstacle [m]",
                    **_JSON,
                },
                (
                    "run=latest",
                    "run=latest rollout.starts_m=[[-0.1,0.05]] rollout.duration_s=5.0",
                    "run=latest obstacle=box obstacle.centre_m=[0.1,0] obstacle.sides_m=[0.02,0.01]",
                ),
            ),
            "eval": Verb(
                "score a trained field and write its certificate",
                {
                    **_RUN,
                    "evaluation=heldout": "trained and held-out demonstrations, side by side",
                    "evaluation=peers": "the protocol of published comparisons",
                    **_JSON,
                },
                ("run=latest", "run=latest evaluation=peers output=json"),
            ),
            "report": Verb("write one HTML page about a run", {**_RUN, **_STORE}, ("run=latest",)),
            "compare": Verb(
                "table of the scores of several runs",
                {"runs=[ID,ID]": "MLflow run ids, paths or latest", **_JSON},
                ("runs=[latest,0f3a]", "runs=[0f3a,77c1] output=json"),
            ),
            "check": Verb(
                "repeat a small pinned experiment; fails where a score got worse than its stored baseline",
                {
                    "check.baseline=PATH": "another baseline than the stored one",
                    "check.update=true": "store the new scores as the baseline",
                    **_JSON,
                },
                ("", "check.update=true"),
            ),
            "ui": _UI,
        },
    ),
}


def overview(program: str) -> str:
    """The text of ``PROGRAM --help``."""
    verbs = PROGRAMS[program].verbs
    width = max(map(len, verbs))
    return "\n".join(
        [
            PROGRAMS[program].summary,
            "",
            f"Usage: {program} VERB [key=value …]",
            "",
            "Verbs:",
            *(f"  {name:<{width}}  {verb.summary}" for name, verb in verbs.items()),
            "",
            f"{program} VERB --help shows a verb's settings, choices and examples; {program} --version the version.",
            f'Tab completion: eval "$({program} -sc install=bash)", or in fish: {program} -sc install=fish | source',
        ]
    )
