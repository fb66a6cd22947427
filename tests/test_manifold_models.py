"""Pose manifolds as files, and what planning asks of them."""

import numpy as np
import pytest
import torch

from geomotion import config as schema
from geomotion import manifold_models
from geomotion.demos import readers
from geomotion.errors import CorruptArtefact
from geomotion.learned_manifold import LearnedManifold
from geomotion.manifold_models import Skill
from geomotion.stages.train_manifold import training_set

JC = schema.JCDataset(name="generated/jc", demos=3, points=40)
CONFIG = schema.ManifoldConfig(latent_dim=2, kernels=20, hidden_units=[16, 8], points=20, mixed_copies=1)
TRAIN = (0, 1)


@pytest.fixture(scope="module")
def data():
    return training_set(readers.read(JC), TRAIN, CONFIG, None)


@pytest.fixture(scope="module")
def skill(data) -> Skill:
    return Skill(manifold_models.build(CONFIG, data.space, 0), CONFIG, data.space, TRAIN, (2,))


def parameters(network) -> torch.Tensor:
    return torch.cat([values.ravel() for values in network.parameters()])


def test_the_seed_decides_the_parameters_and_disturbs_no_other_randomness(data):
    torch.manual_seed(5)
    first, second, other = (manifold_models.build(CONFIG, data.space, seed) for seed in (1, 1, 2))
    drawn = torch.rand(1)
    torch.manual_seed(5)
    torch.testing.assert_close(drawn, torch.rand(1))
    torch.testing.assert_close(parameters(first), parameters(second), rtol=0, atol=0)
    assert (parameters(first) != parameters(other)).any()


def test_a_file_gives_back_what_was_saved(skill, tmp_path):
    manifold_models.save(tmp_path / "model.pt", skill)
    found = manifold_models.load(tmp_path / "model.pt")
    assert (found.config, found.space) == (skill.config, skill.space)
    assert (found.train_demos, found.test_demos) == (TRAIN, (2,))
    torch.testing.assert_close(parameters(found.network), parameters(skill.network), rtol=0, atol=0)


@pytest.mark.parametrize("what", ["truncated", "text", "another kind", "another format"])
def test_files_that_hold_no_manifold_are_refused(skill, tmp_path, what):
    path = tmp_path / "model.pt"
    manifold_models.save(path, skill)
    match what:
        case "truncated":
            path.write_bytes(path.read_bytes()[:200])
        case "text":
            path.write_text("manifold")
        case _:
            document = torch.load(path, weights_only=True)
            torch.save(document | ({"kind": "field"} if what == "another kind" else {"format": 99}), path)
    with pytest.raises(CorruptArtefact, match=r"model\.pt"):
        manifold_models.load(path)


class TestForPlanning:
    @pytest.fixture(scope="class")
    @staticmethod
    def manifold(skill, data) -> LearnedManifold:
        return LearnedManifold(skill, data, schema.MetricConfig())

    def test_decoded_poses_are_in_metres_and_of_unit_length(self, manifold, data):
        decoded = manifold.decode(np.zeros((3, 2)))
        assert np.abs(decoded.states.position_m - data.space.centre_m).max() < 5 * data.space.scale_m
        np.testing.assert_allclose(np.linalg.norm(decoded.states.orientation, axis=1), 1)

    def test_far_from_all_codes_lengths_are_stretched_more(self, manifold):
        near = manifold.all_codes[:1]
        assert manifold.stretch(near + 100)[0] > manifold.stretch(near)[0] > 0

    def test_without_density_the_metric_is_the_thesis(self, skill, data):
        plain = LearnedManifold(skill, data, schema.MetricConfig(density_power=0.0))
        np.testing.assert_allclose(plain.stretch(np.array([[0.0, 0.0], [50.0, -50.0]])), 1)

    def test_anchors_are_one_for_each_group_and_radii_reach_its_demonstrations(self, manifold, data):
        for end in (0, -1):
            anchors = manifold.anchors(end)
            assert anchors.codes.shape == (len(set(data.groups)), 2)
            assert (anchors.radii > 0).all()

    @pytest.mark.parametrize("antipodal", schema.Antipodal)
    def test_the_other_sign_has_codes_where_it_was_shown(self, skill, data, antipodal):
        config = schema.ManifoldConfig(**{**vars(CONFIG), "antipodal": antipodal})
        manifold = LearnedManifold(Skill(skill.network, config, skill.space, TRAIN, (2,)), data, schema.MetricConfig())
        shown = antipodal is not schema.Antipodal.aligned
        assert manifold.shows_both_signs == shown
        assert len(manifold.other_codes) == (shown and sum(len(path) for path in data.paths))
