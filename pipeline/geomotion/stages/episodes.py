"""Let two policies that look grasp and drop the object again and again, and count by contacts and its place."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from geomotion.config import GRASP_PLACES, EpisodesConfig, GraspAndDropDataset
from geomotion.demos.generators.grasp_and_drop_pictures import anywhere_between
from geomotion.demos.generators.panda_grasp_and_drop import DOWN_WXYZ, PLACES_M, REST_M, put
from geomotion.errors import InvalidSetting
from geomotion.figures.episodes import save_episodes_figure
from geomotion.files import read_json, write_json
from geomotion.networks.image_encoder import ImageEncoder
from geomotion.pictured_skills import Eye, load_policy
from geomotion.robot.film import Film
from geomotion.robot.grasp_and_drop import Episode, Episodes, Move
from geomotion.robot.inverse_kinematics import solve_pose
from geomotion.robot.panda import HOME_RAD
from geomotion.robot.scenery import draw_scenery
from geomotion.robot.tabletop import Tabletop
from geomotion.stages.encode import EncodeConfig
from geomotion.tables import aligned
from geomotion.tracking import Artefacts, StageRun

UNSEEN_M = 0.05  # an unseen place is at least so far from every demonstrated one
MOVED_S = (0.2, 1.2)  # when the object is moved
GROUPS = {
    "places": "at the demonstrated places",
    "between": "at unseen places between them",
    "moved": "moved to another place before the grasp",
}
EPISODE_COLUMNS = ("episodes", "succeeded", "share", "failures")


@dataclass(frozen=True)
class EpisodesStageConfig:
    """What the episodes stage needs.

    Attributes:
        episodes: How many, and how.
        dataset: How objects are put down, and how scenes look.
        encoder: By what pictures are encoded.
    """

    episodes: EpisodesConfig
    dataset: GraspAndDropDataset
    encoder: EncodeConfig


@dataclass(frozen=True)
class Planned:
    """One episode before it begins.

    Attributes:
        group: A key of :data:`GROUPS`.
        object_m: Where the object lies at first.
        turn_rad: How it is turned.
        moves: Of the object.
    """

    group: str
    object_m: np.ndarray
    turn_rad: float
    moves: tuple[Move, ...] = ()


def episodes(config: EpisodesStageConfig, inputs: Mapping[str, Artefacts], run: StageRun) -> None:
    """Write ``episodes.json`` and ``film.gif``, of the first episode of the last group.

    Raises:
        MissingData: If there are no weights of the encoder any more.
        InvalidSetting: If they are not those by which pictures were encoded.
    """
    settings, seeing = config.episodes, read_json(inputs["encode"].path("encoder.json"))
    encoder = ImageEncoder(config.encoder.weights, config.encoder.tiles, config.encoder.seed)
    if encoder.digest != seeing["weights_sha256"]:
        expected = "the weights that policies were trained with; these have changed since: set reuse=false"
        raise InvalidSetting("encoder.weights", config.encoder.weights, expected)
    eye = Eye(encoder, config.dataset.picture_px)
    grasp, drop = (
        load_policy(inputs[f"train {name}"].path("model.pt"), inputs[f"embed {name}"].path("embedding.pt"), eye)
        for name in ("grasp", "drop")
    )
    rest_rad = solve_pose(np.array(REST_M), np.array(DOWN_WXYZ), HOME_RAD).joints_rad[0]
    rows, film = [], Film(settings.film_fps)
    with Tabletop() as tabletop:
        rates = settings.control_hz, settings.looks_per_s, settings.look_until_m
        loop = Episodes(tabletop, grasp, drop, rest_rad, *rates)
        planned = list(_planned(config))
        filmed = next(number for number, one in enumerate(planned) if one.group == planned[-1].group)
        for number, one in enumerate(planned):
            tabletop.show(draw_scenery(_generator(config, number), config.dataset.scenery, config.dataset.picture_px))
            tabletop.put_object(one.object_m, one.turn_rad)
            loop.film = film if number == filmed else None
            rows.append(_row(one, loop.run(one.moves)))
    film.save(run.folder / "film.gif")
    document = {
        "encoder": seeing,
        "groups": {name: _counted([row for row in rows if row["group"] == name]) for name in GROUPS},
        "episodes": rows,
    }
    write_json(run.folder / "episodes.json", document)
    save_episodes_figure(rows, PLACES_M, run.folder / "figures")
    shares = {name: found["share"] for name, found in document["groups"].items() if found["episodes"]}
    run.log_series(0, {f"episodes.success.{name}": share for name, share in shares.items()})


def episodes_table(document: Mapping[str, Any]) -> str:
    """What came of the episodes, in lines for people."""
    return aligned([EPISODE_COLUMNS, *episode_rows(document)])


def episode_rows(document: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """A row for each group: how many succeeded, and what became of the others."""
    rows = []
    for name, found in document["groups"].items():
        if found["episodes"]:
            failures = ", ".join(f"{count} {what}" for what, count in found["failures"].items()) or "none"
            counted = f"{found['succeeded']} of {found['episodes']}"
            rows.append((GROUPS[name], counted, f"{found['share']:.1%}", failures))
    return rows


def _planned(config: EpisodesStageConfig) -> Iterator[Planned]:
    settings = config.episodes
    kinds = [("places", settings.per_place * GRASP_PLACES), ("between", settings.between), ("moved", settings.moved)]
    number = 0
    for group, count in kinds:
        for repeat in range(count):
            generator = np.random.default_rng((settings.seed, number))
            number += 1
            meant = PLACES_M[repeat % GRASP_PLACES] if group != "between" else _unseen(generator)
            object_m, turn_rad = put(meant, config.dataset, generator)
            moves: tuple[Move, ...] = ()
            if group == "moved":
                other = (repeat + 1 + int(generator.integers(GRASP_PLACES - 1))) % GRASP_PLACES
                there, _ = put(PLACES_M[other], config.dataset, generator)
                moves = (Move(float(generator.uniform(*MOVED_S)), there),)
            yield Planned(group, object_m, turn_rad, moves)


def _generator(config: EpisodesStageConfig, number: int) -> np.random.Generator:
    return np.random.default_rng((config.episodes.seed, number, 1))


def _unseen(generator: np.random.Generator) -> np.ndarray:
    while True:
        place_m = anywhere_between(generator)
        if np.linalg.norm(PLACES_M - place_m, axis=1).min() >= UNSEEN_M:
            return place_m


def _row(planned: Planned, done: Episode) -> dict[str, Any]:
    return {
        "group": planned.group,
        "outcome": done.outcome.value,
        "succeeded": done.succeeded,
        "object_m": done.object_m.tolist(),
        "aimed_m": done.aimed_m.tolist(),
        "aiming_error_m": float(np.linalg.norm(done.aimed_m[:2] - done.object_m[:2])),
        "moved_after_s": [move.time_s for move in planned.moves],
        "duration_s": done.duration_s,
        "looks": done.looks,
        "conditions": [list(one) for one in done.conditions],
    }


def _counted(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    if not rows:
        return {"episodes": 0}
    succeeded = sum(row["succeeded"] for row in rows)
    return {
        "episodes": len(rows),
        "succeeded": succeeded,
        "share": succeeded / len(rows),
        "failures": dict(Counter(row["outcome"] for row in rows if not row["succeeded"])),
        "median_aiming_error_m": float(np.median([row["aiming_error_m"] for row in rows])),
        "median_duration_s": float(np.median([row["duration_s"] for row in rows])),
    }
