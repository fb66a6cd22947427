import numpy as np
import pytest

from geomotion.figures.body import BodyPicture, figure_body, film_frames

TIME_S = np.linspace(0, 1, 21)


@pytest.fixture
def picture():
    standing = np.array([[0.0, 0.0, 0.9], [0.0, 0.0, 1.8], [0.1, 0.0, 0.0]])
    demonstrated = standing + TIME_S[:, None, None] * np.array([0.0, 1.0, 0.0])
    led = {"from its start": demonstrated, "from elsewhere": demonstrated + np.array([0.0, 0.2, 0.0])}
    return BodyPicture(TIME_S, demonstrated, led, [(0, 1), (0, 2)], np.array([0.0, 1.0, 0.0]))


def test_up_is_up_forward_is_to_the_right_and_lengths_are_kept_across_the_view(picture):
    up, forward = picture.seen(np.array([0.0, 0.0, 1.0])), picture.seen(picture.forward)
    assert up[1] > 0.98
    assert abs(up[0]) < 1e-12
    assert forward[0] > 0.8
    assert abs(forward[1]) < 0.2


def test_there_is_a_row_for_the_demonstration_and_for_each_motion(picture):
    figure = figure_body(picture, snapshots=5)
    assert [len(ax.collections) for ax in figure.axes] == [5, 10, 10]
    assert [ax.get_title("left") for ax in figure.axes] == ["demonstration", *picture.led]
    assert [tick.get_text() for tick in figure.axes[-1].get_xticklabels()] == [
        "0.0 s",
        "0.2 s",
        "0.5 s",
        "0.8 s",
        "1.0 s",
    ]


def test_snapshots_are_in_the_order_of_the_way(picture):
    ticks = figure_body(picture, snapshots=4).axes[-1].get_xticks()
    assert (np.diff(ticks) > 0).all()
    backwards = BodyPicture(
        TIME_S, picture.demonstrated[::-1], {name: led[::-1] for name, led in picture.led.items()}, picture.bones,
        picture.forward,
    )  # fmt: skip
    assert (np.diff(figure_body(backwards, snapshots=4).axes[-1].get_xticks()) < 0).all()


def test_a_film_runs_in_real_time_and_its_frames_differ(picture):
    frames = film_frames(picture, fps=5.0)
    assert len(frames) == 5
    assert {frame.shape for frame in frames} == {(360, 640, 3)}
    assert (frames[0] != frames[-1]).any()


def test_everything_drawn_is_kept(picture):
    arrays = picture.arrays()
    assert arrays["led_1_m"].shape == (21, 3, 3)
    assert arrays["bones"].tolist() == [[0, 1], [0, 2]]
