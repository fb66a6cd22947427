"""Ctrl-C and termination signals as an exception that stages can postpone to a safe point."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from geomotion.errors import Interrupted

SIGNALS = (signal.SIGINT, signal.SIGTERM)
REPEAT_AFTER_S = 0.02
HINT = "Repeat the command to continue where it stopped."


class StopRequest(KeyboardInterrupt):
    """A signal on its way out: no `Exception`, so that nobody takes it for damage of a file or of the store."""

    def __init__(self, signal_number: int) -> None:
        super().__init__(f"stopped by signal {signal_number}")
        self.signal_number = signal_number


class PendingInterrupt:
    """Set when a signal arrived inside :func:`postponed_interrupts`."""

    def __init__(self) -> None:
        self.signal_number: int | None = None

    def raise_if_set(self) -> None:
        """Turn a postponed signal into the exception."""
        if self.signal_number is not None:
            raise Interrupted(self.signal_number, HINT)


@contextmanager
def interrupts_as_errors() -> Iterator[None]:
    """Leave the block with :class:`Interrupted` when a signal arrives (main thread only)."""

    def handle(number: int, frame: FrameType | None) -> None:
        raise StopRequest(number)

    try:
        with _handlers(handle), _lost_requests_sent_again():
            yield
    except StopRequest as stop:
        raise Interrupted(stop.signal_number, HINT) from stop


@contextmanager
def postponed_interrupts() -> Iterator[PendingInterrupt]:
    """Note the first signal and let the loop decide when to stop; a second one stops at once."""
    pending = PendingInterrupt()

    def handle(number: int, frame: FrameType | None) -> None:
        if pending.signal_number is not None:
            raise StopRequest(number)
        pending.signal_number = number

    with _handlers(handle):
        yield pending
    pending.raise_if_set()  # a signal after the loop's last look


@contextmanager
def held_signals() -> Iterator[None]:
    """Let the block end before a signal counts; a second signal stops at once.

    For calls into libraries that log what they unwind, or that leave a connection half closed.
    """
    if threading.current_thread() is not threading.main_thread():  # signals never arrive in another one
        yield
        return
    held: list[int] = []

    def handle(number: int, frame: FrameType | None) -> None:
        if held:
            raise StopRequest(number)
        held.append(number)

    try:
        with _handlers(handle):
            yield
    finally:
        for number in held:
            signal.raise_signal(number)  # for the handler that was there before


@contextmanager
def _lost_requests_sent_again() -> Iterator[None]:
    """Finalisers and callbacks of weak references swallow exceptions: repeat a signal that arrives in one of them."""
    before = sys.unraisablehook

    def hook(lost: "sys.UnraisableHookArgs") -> None:
        if isinstance(lost.exc_value, StopRequest):
            timer = threading.Timer(REPEAT_AFTER_S, os.kill, (os.getpid(), lost.exc_value.signal_number))
            timer.daemon = True
            timer.start()
        else:
            before(lost)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before


@contextmanager
def _handlers(handle: "signal._HANDLER") -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in SIGNALS}
    try:
        for number in SIGNALS:
            signal.signal(number, handle)
        yield
    finally:
        for number, previous in before.items():
            signal.signal(number, previous)
