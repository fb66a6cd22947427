import os
import signal
import time

import pytest

from geomotion.errors import Interrupted
from geomotion.interrupts import held_signals, interrupts_as_errors, postponed_interrupts


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_an_error_of_ours_at_the_end_of_the_block(number):
    with pytest.raises(Interrupted) as stopped, interrupts_as_errors():
        os.kill(os.getpid(), number)
    assert stopped.value.exit_code == 128 + number


def test_nobody_inside_takes_a_signal_for_damage():
    with pytest.raises(Interrupted), interrupts_as_errors():
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except Exception as error:  # as readers of files and databases do
            raise ValueError("this file cannot be read") from error


def test_a_signal_that_arrives_where_exceptions_are_lost_still_counts(capfd):
    class Leaving:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGTERM)

    with pytest.raises(Interrupted), interrupts_as_errors():
        leaving = Leaving()
        del leaving
        time.sleep(10)
    assert capfd.readouterr().err == ""


def test_a_postponed_signal_waits_for_a_safe_point():
    done = []
    with pytest.raises(Interrupted), postponed_interrupts() as pending:
        for step in range(3):
            if step == 1:
                os.kill(os.getpid(), signal.SIGTERM)
            done.append(step)
            pending.raise_if_set()
    assert done == [0, 1]


def test_a_signal_after_the_last_safe_point_is_not_lost():
    with pytest.raises(Interrupted), postponed_interrupts():
        os.kill(os.getpid(), signal.SIGTERM)


def test_the_second_signal_stops_at_once():
    done = []
    with pytest.raises(Interrupted), interrupts_as_errors(), postponed_interrupts():
        os.kill(os.getpid(), signal.SIGINT)
        done.append(1)
        os.kill(os.getpid(), signal.SIGINT)
        done.append(2)
    assert done == [1]


def test_a_held_signal_counts_when_the_block_has_ended():
    done = []
    with pytest.raises(Interrupted) as stopped, interrupts_as_errors():
        with held_signals():
            os.kill(os.getpid(), signal.SIGTERM)
            done.append(1)
        done.append(2)
    assert done == [1] and stopped.value.exit_code == 128 + signal.SIGTERM


def test_a_signal_held_inside_a_loop_that_postpones_waits_for_the_loop():
    done = []
    with pytest.raises(Interrupted), interrupts_as_errors(), postponed_interrupts() as pending:
        with held_signals():
            os.kill(os.getpid(), signal.SIGINT)
        done.append(1)
        pending.raise_if_set()
        done.append(2)
    assert done == [1]


def test_the_second_signal_ends_a_block_that_holds_them():
    done = []
    with pytest.raises(Interrupted), interrupts_as_errors(), held_signals():
        os.kill(os.getpid(), signal.SIGINT)
        done.append(1)
        os.kill(os.getpid(), signal.SIGINT)
        done.append(2)
    assert done == [1]


def test_handlers_are_put_back():
    before = signal.getsignal(signal.SIGINT)
    with interrupts_as_errors(), postponed_interrupts():
        assert signal.getsignal(signal.SIGINT) != before
    assert signal.getsignal(signal.SIGINT) == before
