"""A failure as people and programs are told about it: one line, a JSON document, an exit status.

Exit statuses: 1 circumstances (data, store, disk), 2 a mistake in the command, 70 an error of ours,
128 + n stopped by signal n. Standard library only.
"""

import json
import sys
import traceback
from dataclasses import dataclass
from difflib import get_close_matches

from geomotion.errors import GeomotionError

USAGE = 2
INTERNAL = 70  # EX_SOFTWARE of sysexits.h


class UsageMistake(Exception):
    """The command was written in a way that cannot be carried out; the message says what to write instead."""


@dataclass(frozen=True)
class Failure:
    """What went wrong, in one line."""

    kind: str
    message: str
    exit_code: int


@dataclass(frozen=True)
class Reporter:
    """Tells about failures of one command, in the form that was asked for."""

    command: str
    as_json: bool = False
    debug: bool = False

    def report(self, failure: Failure, error: BaseException | None = None) -> int:
        """Print `failure` (with the traceback of `error` under ``--debug``) and return the exit status."""
        if self.debug and error is not None:
            traceback.print_exception(error)
        print(f"{self.command}: error: {failure.message}", file=sys.stderr)
        if self.as_json:
            print(json.dumps({"error": {"type": failure.kind, "message": failure.message}}), flush=True)
        return failure.exit_code


def usage_error(message: str) -> Failure:
    """A mistake in how the command was written."""
    return Failure("UsageError", message, USAGE)


def pipeline_error(error: Exception) -> Failure:
    """What an exception from the pipeline means: the user's to mend, or ours."""
    kind, message = type(error).__name__, " ".join(str(error).split())
    if isinstance(error, GeomotionError):
        return Failure(kind, message, error.exit_code)
    return Failure(
        kind, f"internal error: {kind}: {message} (repeat with --debug to see where, and please report it)", INTERNAL
    )


def did_you_mean(name: str, options: list[str], prefix: str = "") -> str:
    """`` Did you mean …?`` with the closest of `options`, shown behind `prefix`, or nothing."""
    close = get_close_matches(name, options, n=1, cutoff=0.5)
    return f" Did you mean {prefix + close[0]!r}?" if close else ""
