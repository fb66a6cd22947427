import json
import re
from base64 import b64decode
from io import BytesIO

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from geomotion.errors import CorruptArtefact, MissingArtefact
from geomotion.stages.report_gms import ReportConfig, report_gms
from geomotion.tracking import Artefacts, StageRun

HOSTILE = "<script>alert('x')</script> & \"quoted\""
STAGES = ("ingest", "train", "graph", "plan", "evaluate", "replay")
LEG = {
    "length": 2.0,
    "graph_length": 1.95,
    "energy": 4.0,
    "line_energy": 20.0,
    "clearance_m": 0.0123,
    "apart_m": 0.021,
    "apart_rad": np.radians(6.5),
    "start_residual_m": 0.008,
    "start_residual_rad": np.radians(2.0),
    "goal_residual_m": 0.004,
    "goal_residual_rad": np.radians(1.0),
}
GRAPH = {
    "points_per_axis": 100,
    "nodes": 10_000,
    "edges": 39_402,
    "build_s": 0.31,
    "memory_bytes": 9 * 2**20,
    "cap_m": 0.035,
    "cap_rad": np.radians(12.0),
    "open_share": 0.21,
    "demonstration_lengths": [1.7, 2.4],
    "crossing_length": 24.0,
}
REPLAY = {
    "executed": True,
    "arm": "panda",
    "states": "poses",
    "frame": "panda_grasptarget",
    "timing": "demonstration",
    "duration_s": 7.5,
    "stretch": 1.2,
    "reached_share": 1.0,
    "unreachable": [],
    "ik_worst_m": 0.0004,
    "ik_worst_rad": 0.001,
    "tracking_worst_m": 0.0021,
    "tracking_worst_rad": np.radians(0.4),
    "limit_margin_rad": np.radians(12.0),
    "self_clearance": {"links": ["panda_link5", "panda_hand"], "distance_m": 0.042},
    "clearance_m": {"panda_link1": 0.1, "panda_link7": 0.031, "panda_hand": 0.023},
    "contacts": {},
    "closed_loop": False,
    "replans": 0,
    "replan_median_ms": None,
}


def leg(**changes):
    return {"status": "found", "reason": "found", "blocking": [], "points": 200, "scores": LEG} | changes


def plan(*legs, **changes):
    legs = legs or (leg(),)
    document = {
        "start": "demo:7",
        "goal": "demo:7",
        "legs": list(legs),
        "obstacles": ["sphere"],
        "protected": "the tool",
    }
    return document | {"found": all(one["status"] == "found" for one in legs)} | changes


NO_PATH = leg(
    status="blocked",
    reason="obstacles block every way inside the demonstrations: sphere; planning.leave_data_m= would allow a detour",
    blocking=["sphere"],
    points=0,
    scores=None,
)


def score(value, unit="1", **more):
    return {
        "value": value,
        "unit": unit,
        "count": 2,
        "spread": 0.05,
        "statistic": "mean",
        "values": [],
        "note": "n",
    } | more


def scores(subset="heldout"):
    values = {
        "planned_share": score(1.0, statistic="share", spread=0.0),
        "position_dtwd_ratio": score(0.581),
        "orientation_dtwd_ratio": score(0.472),
        "position_dtwd_ratio_of_averaged_demo": score(0.523, note="baseline: mean of the demonstrations"),
        "orientation_dtwd_ratio_of_averaged_demo": score(0.534, note="baseline: mean of the demonstrations"),
        "position_dtwd_ratio_of_straight_line": score(1.9, note="baseline: straight latent line"),
        "farthest_from_data": score(23.4, "mm", statistic="max"),
        "farthest_from_data_of_demo": score(30.1, "mm", statistic="max"),
        "energy": score(4.0),
        "jerk": score(8123.0),
    }
    found = {f"{subset}.{name}": one for name, one in values.items()}
    omitted = {f"{subset}.demonstration 8": "the start is outside the demonstrated region"}
    return {"protocol": "geodesics", "dataset": "robotasks9/wineglass", "scores": found, "omitted": omitted}


def png():
    content = BytesIO()
    Image.new("RGB", (400, 20)).save(content, "PNG")
    return content.getvalue()


def gif():
    content = BytesIO()
    frames = [Image.new("RGB", (320, 240), colour) for colour in ("white", "black")]
    frames[0].save(content, "GIF", save_all=True, append_images=frames[1:])
    return content.getvalue()


def write(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())


@pytest.fixture
def stages(tmp_path):
    """Builds the artefacts of the stages before the report."""

    def build(planned=None, replayed=REPLAY, judged=None, source="recorded", is_good=True, film=True):
        planned = plan() if planned is None else planned
        folders = {name: tmp_path / name for name in STAGES if name != "replay" or replayed is not None}
        demos = [
            {"demo": n, "label": "", "set": subset, "points": 200, "duration_s": 5.0}
            for n, subset in enumerate(("train", "test"))
        ]
        summary = {"space": "R3xS3", "frame": "base", "source": source, "licence": "MIT", "demos": demos, "steps": []}
        training = {"attempts": 1, "unexplained_variance": 0.012, "folded_share": 0.001, "is_good": is_good}
        write(folders["ingest"] / "summary.json", summary)
        write(folders["train"] / "training.json", training)
        write(folders["train"] / "config.json", {"seed": 7})
        write(
            folders["train"] / "training.csv", pd.DataFrame({"step": [0, 99], "total": [1.0, 0.25]}).to_csv().encode()
        )
        write(folders["graph"] / "graph.json", GRAPH)
        write(folders["plan"] / "plan.json", planned)
        write(folders["plan"] / "scene.html", b"<html>scene</html>")
        write(folders["evaluate"] / "scores.json", scores() if judged is None else judged)
        names = ("demonstrations", "training", "latent", "plan", "geodesics", "replay")
        for stage, name in zip(STAGES, names, strict=True):
            if stage != "replay" or (replayed is not None and planned["found"]):
                write(folders[stage] / f"figures/{name}.png", png())
        if replayed is not None:
            write(folders["replay"] / "replay.json", replayed)
            if film and planned["found"]:
                write(folders["replay"] / "film.gif", gif())
        return {name: Artefacts(name, f"run-of-{name}", folder, "d" * 64) for name, folder in folders.items()}

    return build


def page_of(inputs, tmp_path, config=ReportConfig()):  # noqa: B008
    run = StageRun(tmp_path / "report", tmp_path / "checkpoint", client=None, run_id="run-of-report")
    report_gms(config, inputs, run)
    return (tmp_path / "report/report.html").read_text(encoding="utf-8")


def text_of(page):
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", re.sub(r"(?s)<style>.*</style>", "", page)))


def verdict_of(page):
    tone, body = re.search(r'(?s)<section class="verdict ([^"]*)">(.*?)</section>', page).groups()
    return tone, text_of(body)


def test_page_carries_pictures_and_film_in_itself_and_links_to_the_scene_beside_it(stages, tmp_path):
    page = page_of(stages(), tmp_path)
    references = re.findall(r"(?:src|href|action|data|srcset)\s*=\s*[\"']([^\"']*)", page)
    inlined = [reference.partition(",") for reference in references if reference.startswith("data:")]
    assert [kind for kind, _, _ in inlined].count("data:image/png;base64") == 6
    (film,) = [content for kind, _, content in inlined if kind == "data:image/gif;base64"]
    assert Image.open(BytesIO(b64decode(film))).n_frames == 2
    assert [reference for reference in references if not reference.startswith("data:")] == ["scene.html"]
    assert (tmp_path / "report/scene.html").read_text() == "<html>scene</html>"
    assert not re.search(r"https?://|@import|url\(|<script|<link|<iframe", page)


def test_a_latent_space_to_turn_lies_beside_the_page_where_there_is_one(stages, tmp_path):
    inputs = stages()
    (inputs["plan"].folder / "latent.html").write_bytes(b"<html>tubes</html>")
    page = page_of(inputs, tmp_path)
    assert 'href="latent.html"' in page
    assert (tmp_path / "report/latent.html").read_text() == "<html>tubes</html>"


def test_verdict_says_what_is_guaranteed_and_what_was_measured(stages, tmp_path):
    tone, text = verdict_of(page_of(stages(), tmp_path))
    assert tone == "found"
    for expected in (
        "A path was found",
        "the tool stays at least 12.3 mm away from every obstacle (sphere)",
        "up to 21 mm and 6.5° away from the demonstrations; 35 mm and 12° are allowed",
        "straight latent line would take 5 times its energy",
        "8 mm and 2° from the wanted start, and 4 mm and 1° from the wanted goal",
        "Measured in simulation: the arm follows with at most 2.1 mm and 0.40° of error",
        "nothing of the arm comes nearer to an obstacle than 23 mm (panda_hand)",
    ):
        assert expected in text
    guaranteed, measured = text.index("Guaranteed clearance"), text.index("Measured only")
    assert guaranteed < measured


def test_a_path_of_configurations_is_told_by_links_and_joints(stages, tmp_path):
    checks = {
        "obstacles": ["sphere"],
        "clearances": [{"bodies": ["panda_link4", "sphere"], "distance_m": 0.017, "row": 88}],
        "self_clearance": {"bodies": ["panda_link2", "panda_link4"], "distance_m": 0.068, "row": 3},
        "limit": {"joint": "panda_joint4", "margin_rad": np.radians(21), "row": 120},
        "up_to_m": 0.2,
        "looks": 700,
    }
    planned = plan(leg(checks=checks), protected="every link of the arm")
    replayed = REPLAY | {"states": "configurations", "limit_margin_rad": None, "self_clearance": None}
    page = page_of(stages(planned, replayed), tmp_path)
    tone, text = verdict_of(page)
    assert tone == "found"
    for expected in (
        "every link of the arm stays at least 12.3 mm away",
        "no link comes nearer to an obstacle than 17 mm (panda_link4 to sphere)",
        "come nearer to each other than 68 mm (panda_link2 to panda_link4)",
        "every joint stays 21° or more inside its limits (panda_joint4 comes nearest)",
        "its joints have no limits",
    ):
        assert expected in text
    assert "panda_joint4 to its limit 21° 120" in text_of(page)
    assert "inverse kinematics" not in text_of(page)


def test_no_path_is_an_answer_with_the_reason_and_the_obstacle(stages, tmp_path):
    replayed = {"executed": False, "reason": NO_PATH["reason"]}
    page = page_of(stages(plan(leg(), NO_PATH), replayed), tmp_path)
    tone, text = verdict_of(page)
    assert tone == "not-found"
    assert "No path: obstacles block every way inside the demonstrations: sphere" in text
    assert "There is none for leg 2; 1 of 2 legs have a path" in text
    assert "In the way: sphere." in text
    assert "A way out: planning.leave_data_m= would allow a detour." in text
    assert "Guaranteed, for" not in text and "Tracking error" not in text_of(page)
    assert "On the robot there is no path to execute" in text_of(page)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"tracking_worst_m": 0.0071}, "at most 7.1 mm and 0.40° of error (asked for are 5 mm and 1°)"),
        ({"tracking_worst_rad": np.radians(1.5)}, "(asked for are 5 mm and 1°)"),
        ({"limit_margin_rad": -0.01}, "a joint goes beyond its limits"),
        ({"contacts": {"sphere": {"panda_link5": 12}}}, "the arm touches sphere (panda_link5)"),
        (
            {
                "unreachable": [{"index": 41, "position_error_m": 0.03, "orientation_error_rad": 0.0}],
                "reached_share": 0.995,
            },
            "cannot take 1 of the poses (0.5 %); at worst, at pose 41, 30 mm",
        ),
        (
            {"self_clearance": {"links": ["panda_link1", "panda_hand"], "distance_m": -0.012}},
            "panda_link1 and panda_hand overlap by 12 mm",
        ),
        ({"closed_loop": True, "replans": 40, "replan_median_ms": 3.2, "reached_goal": False}, "it did not arrive"),
    ],
)
def test_whatever_goes_wrong_on_the_robot_makes_the_verdict_doubtful(stages, tmp_path, changes, sentence):
    tone, text = verdict_of(page_of(stages(replayed=REPLAY | changes), tmp_path))
    assert tone == "doubtful"
    assert "with reservations" in text and sentence in text


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"apart_m": 0.05}, "50 mm and 6.5° away from the demonstrations; only 35 mm and 12° are allowed"),
        ({"clearance_m": -0.002}, "No clearance is guaranteed: on the decoded path, the tool may touch an obstacle."),
    ],
)
def test_a_path_that_breaks_a_limit_is_not_praised(stages, tmp_path, changes, sentence):
    tone, text = verdict_of(page_of(stages(plan(leg(scores=LEG | changes))), tmp_path))
    assert tone == "doubtful" and sentence in text


def test_the_plans_own_cap_counts_where_more_was_allowed(stages, tmp_path):
    allowed = plan(leg(scores=LEG | {"apart_m": 0.05}), cap_m=0.06, cap_rad=0.3)
    tone, text = verdict_of(page_of(stages(allowed), tmp_path))
    assert tone == "found" and "; 60 mm" in text


def test_a_bad_latent_space_and_a_cheaper_straight_line_are_said(stages, tmp_path):
    inputs = stages(plan(leg(scores=LEG | {"line_energy": 3.0})), is_good=False)
    tone, text = verdict_of(page_of(inputs, tmp_path))
    assert tone == "doubtful"
    assert "would take less energy, 0.75 of it" in text
    assert "The latent space is not good after one attempt: 1.2 % of the variance is missed" in text


def test_headlines_stand_beside_their_baselines(stages, tmp_path):
    tiles = re.findall(r'(?s)<div class="tile">(.*?)</div>', page_of(stages(), tmp_path))
    shown = [text_of(tile).strip() for tile in tiles]
    assert (
        shown[0] == "DTWD ratio, position 0.581 held-out demonstrations; averaged demonstration 0.523; another one is 1"
    )
    assert shown[1].startswith("DTWD ratio, orientation 0.472")
    assert shown[2] == "Farthest from the data 23.4 mm held-out demonstrations themselves: 30.1 mm"
    assert shown[3] == "Paths found 100 % between the ends of 2 held-out demonstrations"
    assert shown[4].startswith("Tracking error at worst 2.1 mm, 0.40°")


def test_scores_are_ordered_with_baselines_under_them(stages, tmp_path):
    page = page_of(stages(), tmp_path)
    text = text_of(page).partition("Geodesics between the ends of demonstrations")[2]
    rows = [
        "DTWD / distance between demonstrations, position",
        "averaged demonstration instead",
        "straight latent line instead",
        "DTWD / distance between demonstrations, orientation",
        "Farthest from the data",
        "the demonstrations themselves",
        "Dimensionless jerk",
    ]
    assert sorted(rows, key=text.index) == rows
    assert page.count('<tr class="baseline">') == 4
    assert "0.581 ± 0.05 n = 2" in text


def test_without_held_out_demonstrations_training_ones_are_judged_and_that_is_said(stages, tmp_path):
    text = text_of(page_of(stages(judged=scores("train")), tmp_path))
    assert "averaged demonstration 0.523" in text and "training demonstrations themselves: 30.1 mm" in text
    assert "No demonstration was held out" in text


def test_without_robot_the_page_says_why(stages, tmp_path):
    page = page_of(stages(replayed=None), tmp_path)
    tone, text = verdict_of(page)
    assert tone == "found" and "It was not executed: the demonstrations are neither poses in R³×S³" in text
    assert "On the robot no robot: the demonstrations are neither poses in R³×S³" in text_of(page)
    assert "PyBullet" not in text_of(page) and "image/gif" not in page


def test_tables_list_legs_other_pairs_the_execution_and_poses_out_of_reach(stages, tmp_path):
    unreachable = [{"index": n, "position_error_m": 0.001 * n, "orientation_error_rad": 0.1} for n in range(30)]
    planned = plan(leg(**{"from": "demo:0", "to": "demo:1"}), others=[NO_PATH | {"from": "demo:2", "to": "demo:5"}])
    text = text_of(page_of(stages(planned, REPLAY | {"unreachable": unreachable, "reached_share": 0.85}), tmp_path))
    assert "demo:0 to demo:1 2 (1.95) 4 (20) 12.3 21.0, 6.5 8.0, 2.0 4.0, 1.0 found" in text
    assert "demo:2 to demo:5 – – – – – – obstacles block every way" in text
    assert "demonstration, stretched 1.20 times" in text
    assert "panda_hand 23.0 none panda_link7 31.0 none panda_link1 100.0 or more none" in text
    assert "Poses out of reach, the worst 10 of 30" in text and "29 29.0 5.7" in text


def test_caveats_follow_from_the_run(stages, tmp_path):
    text = text_of(page_of(stages(), tmp_path)).partition("What the numbers do not say")[2]
    for expected in (
        "Held-out scores rest on 2 demonstrations",
        "mean of the demonstrations",
        "scaling of the metric",
        "PyBullet",
        "The recordings give their frame as: base. The robot executed them as poses of its frame panda_grasptarget",
    ):
        assert expected in text
    free = text_of(page_of(stages(plan(leg(scores=LEG | {"clearance_m": None}), obstacles=[])), tmp_path))
    assert "moving obstacles" not in free and "There were no obstacles to keep clear of." in free


def test_page_carries_facts_and_origin(stages, tmp_path):
    text = text_of(page_of(stages(), tmp_path, ReportConfig(command="gms run dataset=robotasks9/wineglass seed=7")))
    for expected in (
        "gms run dataset=robotasks9/wineglass seed=7",
        "run-of-graph",
        "Seed 7",
        "100 steps, final loss 0.25",
        "10000 nodes (100 an axis), 39402 edges",
        "Geodesic motion skill from robotasks9/wineglass",
        "Score heldout.demonstration 8 the start is outside the demonstrated region",
    ):
        assert expected in text


def test_names_from_outside_are_escaped(stages, tmp_path):
    planned = plan(leg(**{"from": HOSTILE, "to": HOSTILE}), start=HOSTILE, obstacles=[HOSTILE])
    replayed = REPLAY | {"clearance_m": {HOSTILE: 0.1}, "frame": HOSTILE}
    page = page_of(stages(planned, replayed, source=HOSTILE), tmp_path, ReportConfig(title=HOSTILE, command=HOSTILE))
    assert "<script" not in page
    assert page.count("&lt;script&gt;") >= 10


def test_missing_and_damaged_inputs_are_named_and_nothing_is_written(stages, tmp_path):
    inputs = stages()
    (inputs["graph"].folder / "graph.json").write_text("{")
    with pytest.raises(CorruptArtefact, match=r"graph\.json"):
        page_of(inputs, tmp_path)
    (inputs["ingest"].folder / "summary.json").unlink()
    with pytest.raises(MissingArtefact, match=r"summary\.json"):
        page_of(inputs, tmp_path)
    inputs = stages()
    (inputs["plan"].folder / "scene.html").unlink()
    with pytest.raises(MissingArtefact, match=r"scene\.html"):
        page_of(inputs, tmp_path)
    assert not (tmp_path / "report").exists()
