"""Who may write where: standard output belongs to results."""

import contextlib
import ctypes
import os
import sys
from collections.abc import Iterator
from typing import TextIO


@contextlib.contextmanager
def output_to_stderr() -> Iterator[None]:
    """Send whatever is printed meanwhile to standard error, also by libraries in C and by child processes."""
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        ctypes.CDLL(None).fflush(None)  # what C code has printed but not yet written
        os.dup2(kept, 1)
        os.close(kept)


class _WithoutHydrasRemark:
    """Standard error, less the line that Hydra prints before it raises a job's error: the error has been told."""

    REMARK = "Error executing job with overrides:"

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> object:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        return len(text) if text.startswith(self.REMARK) else self._stream.write(text)


@contextlib.contextmanager
def hydras_remark_removed() -> Iterator[None]:
    """Keep Hydra from announcing failed jobs, which announce themselves."""
    with contextlib.redirect_stderr(_WithoutHydrasRemark(sys.stderr)):  # type: ignore[type-var]
        yield
