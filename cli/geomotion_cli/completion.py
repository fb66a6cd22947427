"""Tab completion: verbs and flags here, settings and choices by Hydra, which knows no verbs.

A shell asks ``PROGRAM -sc query=SHELL`` with the line typed so far in ``COMP_LINE``.
"""

import contextlib
import io
import os
import re

from geomotion_cli.verbs import PROGRAMS

_FLAGS = ["--cfg", "--debug", "--help", "--info", "--multirun", "--resolve", "--version"]
_SEPARATORS = {"fish": "\n"}


def complete(program: str, request: str) -> int:
    """Answer ``install=``, ``uninstall=`` and ``query=`` with a shell's name behind."""
    kind, _, shell = request.partition("=")
    if kind != "query":
        return _ask_hydra(program, request)
    line = _line_before_cursor()
    words = line.split()
    unfinished = words.pop() if words and not line[-1:].isspace() else ""
    match words[1:]:
        case [] | ["help"]:
            _offer(list(PROGRAMS[program].verbs), unfinished, shell)
        case _ if unfinished.startswith("-"):
            _offer(_FLAGS, unfinished, shell)
        case [verb, *_] if verb in PROGRAMS[program].verbs:
            os.environ["COMP_LINE"] = _without_verb(line, verb)
            with contextlib.redirect_stderr(io.StringIO()):  # a line that Hydra cannot read yet has no completions
                _ask_hydra(program, request)
    return 0


def _line_before_cursor() -> str:
    line = os.environ.get("COMP_LINE", "")
    return line[: int(os.environ.get("COMP_POINT") or len(line))]


def _without_verb(line: str, verb: str) -> str:
    line = re.sub(rf"^(\s*\S+\s+){re.escape(verb)}\s", r"\1", line)
    return re.sub(r"\s--debug(?=\s)", "", line)


def _offer(options: list[str], unfinished: str, shell: str) -> None:
    print(_SEPARATORS.get(shell, " ").join(option for option in options if option.startswith(unfinished)))


def _ask_hydra(program: str, request: str) -> int:
    from geomotion_cli.application import run_hydra

    return run_hydra(program, program, ["-sc", request], job=lambda config: None)
