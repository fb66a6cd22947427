"""Which demonstrations and channels an experiment uses."""

from collections import Counter
from collections.abc import Sequence

from geomotion.config import DatasetConfig
from geomotion.demos.demonstrations import VELOCITY_OF, Demonstrations
from geomotion.errors import InvalidSetting, UnknownName

PREFERRED = ("position_m", "joints_rad")  # what a field is learned on, where nothing else is said
HELD_OUT = 2  # by default, where at least two remain to train on


def split(config: DatasetConfig, demonstrations: Demonstrations) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Numbers of the demonstrations to train on and of those held out.

    Where conditions are repeated, as many of each are held out as would be of a set without conditions.

    Raises:
        InvalidSetting: If a number does not exist, is given twice, is on both sides, or nothing is left to train on.
    """
    count = len(demonstrations)
    held_out = HELD_OUT if config.held_out is None else config.held_out
    train = _all_but_last(demonstrations, held_out) if config.train_demos is None else config.train_demos
    _check("dataset.train_demos", train, count)
    if not train:
        raise InvalidSetting("dataset.train_demos", [], f"at least one of the demonstrations 0 to {count - 1}")
    test = [demo for demo in range(count) if demo not in train] if config.test_demos is None else config.test_demos
    _check("dataset.test_demos", test, count)
    if shared := sorted(set(train) & set(test)):
        raise InvalidSetting("dataset.test_demos", list(test), f"none of dataset.train_demos, which also has {shared}")
    return tuple(train), tuple(test)


def state_channels(config: DatasetConfig, demonstrations: Demonstrations) -> tuple[str, ...]:
    """The chosen channels, if a field can be learned on them; unless they are chosen, positions, or else joints.

    Raises:
        UnknownName: If the recordings have no such channel.
        InvalidSetting: If no channel is chosen, one twice, or one whose time derivative is no velocity channel.
    """
    chosen = config.state_channels
    if chosen is None:
        chosen = next(([name] for name in PREFERRED if name in demonstrations.channel_names), list(PREFERRED[:1]))
    if not chosen:
        raise InvalidSetting("dataset.state_channels", [], f"some of {list(demonstrations.channel_names)}")
    if len(set(chosen)) < len(chosen):
        raise InvalidSetting("dataset.state_channels", chosen, "different channels")
    for name in chosen:
        if name not in demonstrations.channel_names:
            raise UnknownName(f"channel of {demonstrations.name}", name, demonstrations.channel_names)
        if name not in VELOCITY_OF:
            raise InvalidSetting("dataset.state_channels", name, f"channels with a velocity: {', '.join(VELOCITY_OF)}")
    return tuple(chosen)


def _all_but_last(demonstrations: Demonstrations, held_out: int) -> list[int]:
    conditions = [trajectory.condition for trajectory in demonstrations.trajectories]
    if min(Counter(conditions).values()) == 1:
        conditions = [()] * len(conditions)  # some are shown once: they cannot be held out each
    members: dict[tuple[float, ...], list[int]] = {}
    for number, condition in enumerate(conditions):
        members.setdefault(condition, []).append(number)
    kept = (numbers[: len(numbers) - held_out * (len(numbers) >= 2 * held_out)] for numbers in members.values())
    return sorted(number for numbers in kept for number in numbers)


def _check(key: str, demos: Sequence[int], count: int) -> None:
    if any(not 0 <= demo < count for demo in demos) or len(set(demos)) < len(demos):
        raise InvalidSetting(key, list(demos), f"different numbers from 0 to {count - 1}")
