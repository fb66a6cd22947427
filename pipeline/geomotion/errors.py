"""Errors for people: what was expected, what was found, what to do next.

Every error that a user can cause derives from :class:`GeomotionError`. The command line prints it as one
line and exits with its ``exit_code``; values are kept as attributes for programs. Outcomes that are not
mistakes (a rollout that leaves the region, a search that finds nothing) are statuses in a result instead.
"""

import errno
from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path


class GeomotionError(Exception):
    """A mistake or circumstance that the user can mend; the message says how."""

    exit_code = 1


class InvalidSetting(GeomotionError):
    """A configuration value that is well-typed but makes no sense."""

    exit_code = 2

    def __init__(self, key: str, found: object, expected: str) -> None:
        super().__init__(f"{key}={found} is not valid: expected {expected}.")
        self.key, self.found, self.expected = key, found, expected


class UnknownName(GeomotionError):
    """A name that is not in a closed list; carries the closest one."""

    exit_code = 2

    def __init__(self, kind: str, name: str, options: Iterable[str]) -> None:
        self.kind, self.name, self.options = kind, name, sorted(options)
        close = get_close_matches(name.lower(), [option.lower() for option in self.options], n=1, cutoff=0.5)
        hint = next((option for option in self.options if close and option.lower() == close[0]), None)
        guess = f" Did you mean {hint!r}?" if hint else ""
        super().__init__(f"unknown {kind} {name!r}.{guess} Available: {', '.join(self.options)}.")


class DatasetError(GeomotionError):
    """A recording that cannot be used: names the place and the rule it breaks."""

    def __init__(self, path: str | Path, reason: str) -> None:
        super().__init__(f"{path}: {reason}")
        self.path, self.reason = str(path), reason


class MissingData(GeomotionError):
    """Data that have to be fetched by the user; the message says from where."""

    def __init__(self, what: str, how_to_get: str) -> None:
        super().__init__(f"{what} not found. {how_to_get}")
        self.what, self.how_to_get = what, how_to_get


class MissingRun(GeomotionError):
    """``run=`` names nothing that exists."""

    def __init__(self, run: str, reason: str) -> None:
        super().__init__(f"run={run}: {reason}")
        self.run, self.reason = run, reason


class MissingArtefact(GeomotionError):
    """A run exists but lacks what a later stage needs."""

    def __init__(self, stage: str, name: str, run_id: str, program: str) -> None:
        verb = "eval" if stage == "evaluate" else stage
        super().__init__(
            f"run {run_id} has no {name!r} of stage {stage!r}. Repeat that stage: {program} {verb} reuse=false."
        )
        self.stage, self.name, self.run_id = stage, name, run_id


class CorruptArtefact(GeomotionError):
    """A stored file that differs from what was written, or cannot be read."""

    def __init__(self, path: str | Path, reason: str) -> None:
        super().__init__(f"{path} is corrupt: {reason}. Delete it or repeat the stage with reuse=false.")
        self.path, self.reason = str(path), reason


class StoreUnavailable(GeomotionError):
    """The MLflow store cannot be opened or written."""

    def __init__(self, uri: str, reason: str) -> None:
        super().__init__(
            f"MLflow store {uri} cannot be used: {reason}. "
            "Set tracking.root= to another folder or tracking.uri= to another store."
        )
        self.uri, self.reason = uri, reason


class DiskFull(GeomotionError):
    """Writing failed for lack of space; nothing half-written is kept."""

    def __init__(self, path: str | Path) -> None:
        super().__init__(
            f"no space left while writing {path}. Free some space, or write elsewhere with tracking.root=; "
            "then repeat the command: finished stages are reused."
        )
        self.path = str(path)


class TrainingDiverged(GeomotionError):
    """A loss or parameter became NaN or infinite."""

    def __init__(self, step: int, loss: float) -> None:
        super().__init__(
            f"training diverged at step {step}: the loss is {loss}. Lower training.learning_rate or try another seed."
        )
        self.step, self.loss = step, loss


class ShapeMismatch(GeomotionError):
    """Arrays whose dimensions do not fit together."""

    def __init__(self, what: str, expected: object, found: object) -> None:
        super().__init__(f"{what}: expected {expected}, found {found}.")
        self.what, self.expected, self.found = what, expected, found


class Interrupted(GeomotionError):
    """Stopped by Ctrl-C or a termination signal; a checkpoint was kept."""

    def __init__(self, signal_number: int, hint: str) -> None:
        super().__init__(f"stopped by signal {signal_number}. {hint}")
        self.signal_number = signal_number
        self.exit_code = 128 + signal_number


class TooLargeForMemory(GeomotionError):
    """Something that would not fit into memory; said before anything is allocated."""

    exit_code = 2

    def __init__(self, what: str, needed_bytes: int, limit_bytes: int, fitting: str) -> None:
        super().__init__(
            f"{what} would need about {needed_bytes / 2**30:.3g} GiB, the limit is {limit_bytes / 2**30:.3g} GiB. "
            f"{fitting} fits."
        )
        self.needed_bytes, self.limit_bytes, self.fitting = needed_bytes, limit_bytes, fitting


def is_disk_full(error: OSError) -> bool:
    """Whether an operating-system error means that space, quota or a file-size limit ran out."""
    return error.errno in {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
