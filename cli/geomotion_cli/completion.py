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
    options = _options(program, words[1:], unfinished, line)
    print(_SEPARATORS.get(shell, " ").join(option for option in options if option.startswith(unfinished)))
    return 0


def _options(program: str, words: list[str], unfinished: str, line: str) -> list[str]:
    verbs = PROGRAMS[program].verbs
    match words:
        case [] | ["help"]:
            return list(verbs)
        case [verb, *_] if verb not in verbs:
            return []
        case _ if unfinished.startswith("-"):
            return _FLAGS
        case [verb, *_]:
            return _choices(program, unfinished) or _settings(program, _without_verb(line, verb))
    return []


def _choices(program: str, unfinished: str) -> list[str]:
    """Options of a group, behind ``group=``; Hydra offers those of one folder only."""
    from geomotion_cli.choices import program_options

    group, equals, value = unfinished.partition("=")
    if not equals or "." in group or "/" in group:
        return []
    chosen = value[: value.rfind(",") + 1]  # a sweep's earlier values
    return [f"{group}={chosen}{option}" for option in program_options(program).get(group, [])]


def _settings(program: str, line: str) -> list[str]:
    """Hydra's answer, mended: groups are offered as settings, not as folders, and choices without their type."""
    os.environ["COMP_LINE"] = line
    answer = io.StringIO()
    with contextlib.redirect_stdout(answer), contextlib.redirect_stderr(io.StringIO()):
        _ask_hydra(program, "query=bash")  # prints a usage on standard error where it cannot read the line yet
    words = [re.sub(r"=[A-Z]\w*\.", "=", word) for word in answer.getvalue().split() if word != "hydra"]
    return [word if "=" in word or word.endswith(".") else f"{word.rstrip('/')}=" for word in words]


def _line_before_cursor() -> str:
    line = os.environ.get("COMP_LINE", "")
    return line[: int(os.environ.get("COMP_POINT") or len(line))]


def _without_verb(line: str, verb: str) -> str:
    line = re.sub(rf"^(\s*\S+\s+){re.escape(verb)}\s", r"\1", line)
    return re.sub(r"\s--debug(?=\s)", "", line)


def _ask_hydra(program: str, request: str) -> int:
    from geomotion_cli.application import run_hydra

    return run_hydra(program, program, ["-sc", request], job=lambda config: None)
