from copy import copy

import numpy as np
import pytest
import torch

from geomotion.errors import InvalidSetting, MissingData
from geomotion.networks.image_encoder import FEATURES, ImageEncoder, digest_of_weights

PICTURES = np.random.default_rng(0).integers(0, 256, (3, 32, 32, 3), dtype=np.uint8)


def small(outputs):
    from transformers import ResNetConfig

    return ResNetConfig(depths=[1], hidden_sizes=[8], embedding_size=8, layer_type="basic", num_labels=outputs)


@pytest.fixture(scope="module")
def encoder():
    return ImageEncoder("random", seed=1)


def test_random_weights_are_seeded_and_say_what_they_are(encoder):
    assert "random" in encoder.name and "untrained" in encoder.name
    assert encoder.digest != ImageEncoder("random", seed=2).digest
    assert encoder.digest == ImageEncoder("random", seed=1).digest
    assert encoder(PICTURES).shape == (3, FEATURES)
    assert not any(parameter.requires_grad for parameter in encoder.parameters())


def test_weights_from_a_folder_give_the_same_features(encoder, tmp_path):
    encoder.network.save_pretrained(tmp_path)
    stored = ImageEncoder(str(tmp_path))
    assert stored.digest == encoder.digest and stored.name == str(tmp_path)
    torch.testing.assert_close(stored(PICTURES), encoder(PICTURES), rtol=0, atol=0)


def test_other_weights_behind_the_same_name_have_another_digest(encoder, tmp_path):
    encoder.network.save_pretrained(tmp_path)
    before = digest_of_weights(str(tmp_path))
    ImageEncoder("random", seed=5).network.save_pretrained(tmp_path)
    digest_of_weights.cache_clear()  # as in another process
    assert before == encoder.digest != digest_of_weights(str(tmp_path))


def test_tiles_are_parts_of_the_picture(encoder):
    tiled = copy(encoder)
    tiled.tiles = 3
    features = tiled(PICTURES[:1])
    assert features.shape == (1, tiled.width) == (1, 9 * FEATURES)
    for tile, (top, left) in ((0, (0, 0)), (5, (8, 16))):
        part = encoder(PICTURES[:1, top : top + 16, left : left + 16])
        torch.testing.assert_close(features[:, tile * FEATURES :][:, :FEATURES], part)


def test_missing_weights_name_the_command_that_gets_them(tmp_path):
    folder = tmp_path / "nothing"
    with pytest.raises(MissingData, match=f"hf download microsoft/resnet-18 --local-dir {folder}"):
        ImageEncoder(str(folder))


def test_what_was_never_downloaded_from_the_hub_names_the_command():
    with pytest.raises(MissingData, match="hf download someone/resnet`"):
        ImageEncoder("someone/resnet")


def test_another_network_is_refused(tmp_path):
    from transformers import ResNetForImageClassification

    ResNetForImageClassification(small(outputs=5)).save_pretrained(tmp_path)
    with pytest.raises(InvalidSetting, match="1000 outputs; this network has 5"):
        ImageEncoder(str(tmp_path))


def test_weights_that_are_not_all_there_are_not_made_up(tmp_path):
    from transformers import ResNetModel

    ResNetModel(small(FEATURES)).save_pretrained(tmp_path)
    with pytest.raises(InvalidSetting, match=r"these lack classifier\.1\.bias, classifier\.1\.weight"):
        ImageEncoder(str(tmp_path))
    (tmp_path / "model.safetensors").write_bytes(b"nothing")
    with pytest.raises(InvalidSetting, match="weights that can be read"):
        ImageEncoder(str(tmp_path))
