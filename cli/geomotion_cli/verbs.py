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
    "field=mlp": "or neural_ode: networks without any promise, for comparison",
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

_DATASET_OF_POSES = {"dataset=panda/reach_to_grasp": "poses to learn from; every choice is listed below"}
_MANIFOLD = {
    "manifold.latent_dim=2": "dimension of the manifold: 2 or 3",
    "manifold.antipodal=aligned": "or doubled, mixture: what is done about q and -q being one orientation",
    "manifold.carry_ends=true": "learn demonstrations carried to one start and goal; false: as they are",
}
_PLANNING = {
    "planning.start=demo:0 planning.goal=demo:3": "ends: demo:N, latent:A:B, or a pose [x,y,z,qw,qx,qy,qz]",
    "planning.via=[demo:2]": "further poses on the way",
    "planning.clearance_m=0.01": "distance kept to obstacles [m]",
    "planning.tool_radius_m=0.0": "of a grasped object [m]",
    "planning.leave_data_m=0.02": "how much farther from the demonstrations a path may go [m]",
    "obstacle=sphere obstacle.centre_m=[0.5,0,0.3] obstacle.radius_m=0.05": "an obstacle [m]; also box, ellipsoid, "
    "mesh, point_cloud, several",
}
_COMPARE = Verb(
    "table of the scores of several runs",
    {"runs=[ID,ID]": "MLflow run ids, paths or latest", **_JSON},
    ("runs=[latest,0f3a]", "runs=[0f3a,77c1] output=json"),
)
_COMPARE_FIELDS = Verb(
    "table of the scores of several runs, or of every cell of a study",
    {
        "runs=[ID,ID]": "MLflow run ids, paths or latest",
        "experiment=thesis/table_6_2": "a study: methods x datasets x seeds, resumable",
        "study.jobs=2": "cells at once on this machine",
        "study.shards=4 study.shard=0": "a part of the cells, for one job or machine",
        "tracking.merge=[FOLDER]": "take over what other results folders have",
        **_JSON,
    },
    ("runs=[latest,0f3a]", "experiment=thesis/table_6_2 study.seeds=[0,1,2]"),
)
_CHECK = Verb(
    "repeat a small pinned experiment; fails where a score got worse than its stored baseline",
    {
        "check.baseline=PATH": "another baseline than the stored one",
        "check.update=true": "store the new scores as the baseline",
        **_JSON,
    },
    ("", "check.update=true"),
)

PROGRAMS = {
    "gms": Program(
        "Geodesic motion skills: demonstrated motion as shortest paths on a learned manifold, around obstacles.",
        {
            "run": Verb(
                "the whole chain: ingest, train, graph, plan, eval, replay, report",
                {**_DATASET_OF_POSES, **_MANIFOLD, **_PLANNING, **_TRAINING, **_JSON},
                (
                    "dataset=panda/reach_to_grasp",
                    "dataset=robotasks9/wineglass",
                    "-m dataset=robotasks9/wineglass,robotasks9/scoop seed=0,1,2",
                ),
            ),
            "ingest": _INGEST,
            "train": Verb(
                "fit a manifold to demonstrated poses; continues where an interrupted training stopped",
                {**_DATASET_OF_POSES, **_MANIFOLD, **_TRAINING, **_JSON},
                ("dataset=robotasks9/wineglass", "dataset=panda/reach_to_grasp manifold.latent_dim=3"),
            ),
            "graph": Verb(
                "decode the latent grid that geodesics are searched on",
                {
                    **_RUN,
                    "graph.points_per_axis=100": "resolution",
                    "metric.density_power=2": "how much geodesics keep to dense data; 0: the thesis' metric",
                    **_JSON,
                },
                ("run=latest", "run=latest graph.points_per_axis=150"),
            ),
            "plan": Verb(
                "find a geodesic between poses, around obstacles; exit status 3 where there is none",
                {**_RUN, **_PLANNING, **_JSON},
                (
                    "run=latest",
                    "run=latest planning.start=demo:0 planning.goal=demo:3",
                    "run=latest obstacle=sphere obstacle.centre_m=[0.5,0,0.3] obstacle.radius_m=0.05",
                    "run=latest obstacle=mesh obstacle.file=duck.obj obstacle.scale=0.1 obstacle.centre_m=[0.5,0,0.3]",
                ),
            ),
            "eval": Verb(
                "score geodesics between the ends of held-out demonstrations",
                {**_RUN, **_JSON},
                ("run=latest", "run=latest output=json"),
            ),
            "replay": Verb(
                "execute a planned motion on the simulated Panda, replanning where obstacles move; makes a film",
                {
                    **_RUN,
                    **_PLANNING,
                    "robot.timing=demonstration": "or fastest: as fast as the joints' limits allow",
                    "robot.frame=grasp_target": "or flange: which frame of the arm the poses are of",
                    **_JSON,
                },
                (
                    "run=latest",
                    "run=latest obstacle=sphere obstacle.centre_m=[0.5,0,0.3] obstacle.radius_m=0.05 "
                    "obstacle.velocity_m_per_s=[0,0.05,0]",
                ),
            ),
            "report": Verb("write one HTML page about a run", {**_RUN, **_STORE}, ("run=latest",)),
            "compare": _COMPARE,
            "check": _CHECK,
            "ui": _UI,
        },
    ),
    "ncds": Program(
        "Neural contractive dynamical systems: vector fields learned from a handful of demonstrations.",
        {
            "run": Verb(
                "the whole chain: ingest, train, rollout, eval, report; poses also on the simulated Panda",
                {
                    **_DATASET,
                    **_MODEL,
                    "experiment=thesis/ncds": "the thesis' own settings",
                    "experiment=thesis/table_5_1": "a study: many runs, one table; also table_5_2, fig_5_10, …",
                    **_TRAINING,
                    **_JSON,
                },
                (
                    "dataset=lasa/angle",
                    "dataset=lasa/angle field=line_integral",
                    "-m dataset=letters/c,letters/s seed=0,1",
                    "experiment=thesis/table_5_1 study.jobs=2",
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
            "export": Verb(
                "write the policy as an ONNX file that runs without this library, with an example in Python",
                {
                    **_RUN,
                    "policy.range_margin=0.5": "how far from the demonstrations its status says `outside`",
                    "policy.obstacle.reactivity=1.0": "how far a ball in the way, told at run time, is felt",
                    **_JSON,
                },
                ("run=latest", "dataset=robotasks9/pouring space=R3xSO3 field.skill_dim=2"),
            ),
            "replay": Verb(
                "let the policy lead the simulated Panda while it is pushed; makes a film; exit status 3 out of reach",
                {
                    **_RUN,
                    "replay.start=demo:0": "from the first state of a demonstration, or from a state",
                    "replay.pushes=[{time_s:5,force_n:[0,20,0],duration_s:0.25}]": "forces at the tip [N], or "
                    "displacement_m; [] for none",
                    "replay.goal_changes=[{time_s:4,shift_m:[0,0.05,0]}]": "the goal is elsewhere from then on [m]",
                    "replay.noise_m=0.002 replay.noise_rad=0.01": "of what is measured",
                    "replay.latency_s=0.05": "how old what is measured is",
                    "replay.control_hz=60": "how often the policy is asked; divides 240",
                    "obstacle=sphere obstacle.centre_m=[0.5,0,0.3] obstacle.radius_m=0.05": "in the way of the tip [m]",
                    **_JSON,
                },
                (
                    "run=latest",
                    "run=latest replay.pushes=[] replay.latency_s=0.1",
                    "run=latest obstacle=sphere obstacle.centre_m=[0.5,0,0.3] obstacle.radius_m=0.05 "
                    "obstacle.velocity_m_per_s=[0,0.05,0]",
                ),
            ),
            "report": Verb("write one HTML page about a run", {**_RUN, **_STORE}, ("run=latest",)),
            "compare": _COMPARE_FIELDS,
            "check": _CHECK,
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
