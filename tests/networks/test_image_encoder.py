import numpy as np
import pytest
import torch

from geomotion.errors import InvalidSetting, MissingData
from geomotion.networks.image_encoder import FEATURES, ImageEncoder

PICTURES = np.random.default_rng(0).integers(0, 256, (3, 32, 32, 3), dtype=np.uint8)


@pytest.fixture(scope="module")
def encoder():
    return ImageEncoder("random", seed=1)


def test_random_weights_are_seeded_and_say_what_they_are(encoder):
    other = ImageEncoder("random", seed=2)
    assert "random" in encoder.name and "untrained" in encoder.name
    assert encoder.digest != other.digest
    torch.testing.assert_close(encoder(PICTURES), ImageEncoder("random", seed=1)(PICTURES))
    assert encoder(PICTURES).shape == (3, FEATURES)
    assert not any(parameter.requires_grad for parameter in encoder.parameters())


def test_weights_from_a_folder_give_the_same_features(encoder, tmp_path):
    encoder.network.save_pretrained(tmp_path)
    stored = ImageEncoder(str(tmp_path))
    assert stored.digest == encoder.digest and stored.name == str(tmp_path)
    torch.testing.assert_close(stored(PICTURES), encoder(PICTURES), rtol=0, atol=0)


def test_tiles_are_parts_of_the_picture(encoder):
    tiled = ImageEncoder("random", tiles=3, seed=1)
    assert tiled(PICTURES).shape == (3, 9 * FEATURES)
    torch.testing.assert_close(tiled(PICTURES)[:, :FEATURES], encoder(PICTURES[:, :16, :16]))


def test_missing_weights_name_the_command_that_gets_them(tmp_path):
    folder = tmp_path / "nothing"
    with pytest.raises(MissingData, match=f"hf download microsoft/resnet-18 --local-dir {folder}"):
        ImageEncoder(str(folder))


def test_what_was_never_downloaded_from_the_hub_names_the_command():
    with pytest.raises(MissingData, match="hf download someone/resnet`"):
        ImageEncoder("someone/resnet")


def test_another_network_is_refused(tmp_path):
    from transformers import ResNetConfig, ResNetForImageClassification

    small = ResNetConfig(depths=[1], hidden_sizes=[8], embedding_size=8, layer_type="basic", num_labels=5)
    ResNetForImageClassification(small).save_pretrained(tmp_path)
    with pytest.raises(InvalidSetting, match="1000 outputs"):
        ImageEncoder(str(tmp_path))
