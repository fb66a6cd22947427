"""What is wrong with recordings, settings and obstacles meets `gms` in one clear line, and leaves nothing half-done."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

TOY = (
    "dataset=folder", "manifold.kernels=50", "manifold.points=50", "training.steps=150", "training.spread_steps=40",
    "training.restarts=0", "graph.points_per_axis=30", "robot.film=false",
)  # fmt: skip
PLAN = ("graph.points_per_axis=30",)


def motion(points: int, bend: float = 0.0, turn_rad: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """Poses on a bow in front of the arm, the hand pointing down and turning."""
    share = np.linspace(0, 1, points)
    eased = share * share * (3 - 2 * share)
    bow = (0.15 + 0.01 * bend) * np.sin(np.pi * share)
    position_m = np.stack([0.35 + 0.2 * eased, -0.2 + 0.4 * eased, 0.45 - bow], axis=1)
    turns = Rotation.from_rotvec(np.outer((turn_rad + 0.03 * bend) * eased, [0, 0, 1])) * Rotation.from_rotvec(
        [np.pi, 0, 0]
    )
    return position_m, turns.as_quat(scalar_first=True)


def write(root: Path, number: int, position_m, wxyz, duration_s: float = 3.0, **columns) -> None:
    root.mkdir(exist_ok=True)
    table = {"time_s": np.linspace(0, duration_s, len(position_m)), **dict(zip("xyz", position_m.T, strict=True))}
    table |= {f"orientation_{axis}": values for axis, values in zip("wxyz", wxyz.T, strict=True)}
    pd.DataFrame(table | columns).to_csv(root / f"{number}.csv", index=False)


def recordings(root: Path, count: int = 5, **columns) -> Path:
    for number in range(count):
        write(root, number, *motion(60, number - 2), **columns)
    return root


@pytest.fixture(scope="module")
def good(tmp_path_factory) -> Path:
    return recordings(tmp_path_factory.mktemp("recordings"))


@pytest.fixture
def trained(here, good) -> str:
    """Id of a trained run; trained once, reused then."""
    answer = here("gms", "train", *TOY, f"dataset.root={good}", "output=json").done()
    assert answer.complaints == []
    return answer.document["run_id"]


class TestRecordings:
    def test_quaternions_that_are_mended_are_counted_in_one_warning(self, here, tmp_path):
        root = recordings(tmp_path / "odd", 3)
        position_m, wxyz = motion(60)
        write(root, 1, position_m, 1.004 * wxyz)
        flipped = wxyz.copy()
        flipped[20:40] *= -1
        write(root, 2, position_m, flipped)
        answer = here("gms", "ingest", "dataset=folder", f"dataset.root={root}").done()
        assert answer.complaints == [
            "folder: mended 60 quaternions that were not of unit length and 2 flips of their sign"
        ]

    @pytest.mark.parametrize(("value", "words"), [(np.nan, "expected finite numbers"), (0.0, "norm")])
    def test_quaternions_that_cannot_be_are_refused_by_file_and_row(self, refused, tmp_path, value, words):
        root = recordings(tmp_path / "broken", 3)
        position_m, wxyz = motion(60)
        wxyz[7] = value
        write(root, 1, position_m, wxyz)
        command = ("gms", "train", *TOY, f"dataset.root={root}")
        refused(command, words, "ingest")
        refused(command, "1.csv: demonstration 0 (1), row 7", "ingest")

    def test_positions_alone_are_refused_with_what_is_needed(self, refused):
        settings = [setting for setting in TOY if not setting.startswith("dataset")]
        refused(("gms", "run", "dataset=letters/j", *settings), "needs position_m and either orientation_wxyz", "train")

    @pytest.mark.parametrize("what", ["one demonstration", "two that are identical", "one orientation"])
    def test_unusual_ones_are_learned_planned_and_judged(self, here, tmp_path, what):
        match what:
            case "one demonstration":
                recordings(tmp_path / "data", 1)
            case "two that are identical":
                for number in range(2):
                    write(tmp_path / "data", number, *motion(60))
            case "one orientation":
                for number in range(5):
                    position_m, wxyz = motion(60, number - 2)
                    write(tmp_path / "data", number, position_m, np.tile(wxyz[0], (60, 1)))
        answer = here("gms", "eval", *TOY, f"dataset.root={tmp_path / 'data'}", "output=json").done()
        assert answer.complaints == []
        scores = answer.document["scores"]
        (planned,) = (score for name, score in scores["scores"].items() if name.endswith("planned_share"))
        assert planned["value"] == 1
        judged = ["position"] if what == "one orientation" else []
        ratios = {name.split(".")[1] for name in scores["scores"] if name.endswith("_dtwd_ratio")}
        assert ratios == {f"{part}_dtwd_ratio" for part in judged}
        assert len([name for name in scores["omitted"] if name.endswith("_dtwd_ratio")]) == 2 - len(judged)

    def test_labels_make_groups_of_demonstrations_of_any_length_and_rate(self, here, tmp_path):
        root = tmp_path / "labelled"
        for number in range(6):
            points = (25, 60, 110)[number % 3]
            position_m, wxyz = motion(points, number % 3)
            group = ("low", "high")[number // 3]
            shifted_m = position_m + np.array([0, 0, 0.05 * (number // 3)])
            write(root, number, shifted_m, wxyz, duration_s=2.0 + number, demo=[group] * points)
        command = ("gms", "eval", *TOY, f"dataset.root={root}", "dataset.test_demos=[]", "output=json")
        answer = here(*command, "dataset.train_demos=[0,1,2,3,4,5]").done()
        assert answer.complaints == []
        assert answer.document["scores"]["scores"]["pairs.planned_share"]["count"] == 4


SETTINGS = {
    "a grid too large": (("graph.points_per_axis=20000",), "would need about 355 GiB, the limit is 4 GiB"),
    "four latent dimensions": (("manifold.latent_dim=4",), "expected 2 or 3: geodesics need a grid"),
    "a number that is none": (("planning.start=[0.4,0,nan,1,0,0,0]",), "planning.start is or holds a number"),
    "an endless clearance": (("planning.clearance_m=inf",), "planning.clearance_m is or holds a number"),
    "an unknown key": (("planning.gaol=demo:0",), "Did you mean 'planning.goal'?"),
    "an unknown constraint": (("planning.constraint=strict",), "expected one of [hard, soft, both]"),
    "half a pair": (("planning.others=[[demo:0]]",), "pairs [start, goal]"),
    "no obstacle in a list": (("obstacle=several", "obstacle.bodies=[]"), "one obstacle or more"),
    "an unknown shape": (("obstacle=several", "obstacle.bodies=[{shape:ball}]"), "unknown shape of an obstacle"),
}  # fmt: skip


@pytest.mark.parametrize("what", SETTINGS)
def test_settings_that_make_no_sense_are_refused_before_anything_is_computed(what, refused, good):
    settings, words = SETTINGS[what]
    refused(("gms", "run", *TOY, f"dataset.root={good}", *settings), words, "ingest", 2)


def test_a_grid_too_large_for_a_trained_run_is_refused_too(refused, trained):
    refused(
        ("gms", "graph", f"run={trained}", "graph.points_per_axis=20000"), "graph.points_per_axis=2124 fits", "graph", 2
    )


def cube(path: Path, without: int = 0) -> Path:
    import trimesh

    box = trimesh.creation.box((0.04, 0.04, 0.04))
    trimesh.Trimesh(box.vertices, box.faces[: len(box.faces) - without], process=False).export(path)
    return path


class TestObstacles:
    WHERE = "obstacle.centre_m=[0.45,0,0.9]"

    def test_an_open_mesh_is_used_with_a_warning_that_counts_its_open_edges(self, here, trained, tmp_path):
        path = cube(tmp_path / "open.obj", without=2)
        obstacle = ("obstacle=mesh", f"obstacle.file={path}", self.WHERE)
        answer = here("gms", "plan", f"run={trained}", *PLAN, *obstacle).done()
        (line,) = answer.complaints
        assert line.startswith(f"{path} is not watertight: 4 edges")
        assert "found" in answer.out

    def test_files_that_cannot_be_used_are_refused_by_name(self, refused, trained, tmp_path):
        text = cube(tmp_path / "good.obj").read_text().splitlines()
        vertex = next(number for number, line in enumerate(text) if line.startswith("v "))
        (tmp_path / "nan.obj").write_text("\n".join([*text[:vertex], "v nan 0 0", *text[vertex + 1 :]]))
        (tmp_path / "empty.obj").write_text("")
        np.save(tmp_path / "empty.npy", np.zeros((0, 3)))
        for kind, name, words in (
            ("mesh", "nan.obj", ": 1 of 8 points are NaN or infinite"),
            ("mesh", "empty.obj", ": has no faces"),
            ("mesh", "nowhere.obj", " (mesh) not found"),
            ("point_cloud", "empty.npy", ": holds no points"),
            ("point_cloud", "nowhere.xyz", " (point cloud) not found"),
        ):
            file = tmp_path / name
            command = ("gms", "plan", f"run={trained}", *PLAN, f"obstacle={kind}", f"obstacle.file={file}", self.WHERE)
            refused(command, f"{file}{words}", "plan")

    def test_another_content_of_a_file_is_another_plan_and_the_same_one_is_reused(self, here, trained, tmp_path):
        cloud = ("obstacle=point_cloud", f"obstacle.file={tmp_path / 'a.npy'}", self.WHERE)
        runs = []
        for points in (1, 1, 2):
            np.save(tmp_path / "a.npy", np.zeros((points, 3)))
            answer = here("gms", "plan", f"run={trained}", *PLAN, *cloud, "output=json").done()
            runs.append(answer.run_id("plan"))
        assert runs[0] == runs[1] != runs[2]


def test_an_answer_without_a_path_has_a_status_of_its_own(here, trained):
    far = ("planning.goal=[1.5,0,0.3,0,1,0,0]", *PLAN)
    for verb in ("plan", "replay"):
        answer = here("gms", verb, f"run={trained}", *far).done(3)
        assert answer.complaints == []
        assert "the goal is outside the demonstrated region" in answer.out
        assert "Traceback" not in answer.out


def test_poses_that_the_arm_cannot_take_are_listed_with_what_is_missing(here, good):
    settings = ("dataset.preprocess.scale=4", "planning.samples=20")
    answer = here("gms", "replay", *TOY, f"dataset.root={good}", *settings).done(3)
    assert answer.complaints == []
    assert "0.0% of the poses" in answer.out
    assert "pose 0" in answer.out and "out of reach" in answer.out and " mm, " in answer.out
