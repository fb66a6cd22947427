"""Entry points of `gms` and `ncds`: find the verb and hand the rest to Hydra.

Standard library only at import, so that help and typing errors are answered at once.
"""

import os
import sys
from typing import TYPE_CHECKING

from geomotion_cli.failures import USAGE, Reporter, did_you_mean, usage_error
from geomotion_cli.verbs import PROGRAMS, overview

if TYPE_CHECKING:
    from geomotion_cli.application import RunVerb

HELP_FLAGS = {"-h", "--help"}
COMPLETION_FLAGS = {"-sc", "--shell-completion"}
BROKEN_PIPE = 141  # 128 + SIGPIPE
STOPPED = 130  # 128 + SIGINT


def gms() -> int:
    """Console script `gms`."""
    return main("gms", sys.argv[1:])


def ncds() -> int:
    """Console script `ncds`."""
    return main("ncds", sys.argv[1:])


def main(program: str, arguments: list[str], run_verb: "RunVerb | None" = None) -> int:
    """Answer one command line and return its exit status.

    Args:
        program: `gms` or `ncds`.
        arguments: What follows it.
        run_verb: What carries a verb out; the pipeline if omitted.
    """
    try:
        status = _dispatch(program, arguments, run_verb)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader left, as in `ncds --help | head -1`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except KeyboardInterrupt:
        print(f"{program}: stopped.", file=sys.stderr)
        return STOPPED
    return status


def _dispatch(program: str, arguments: list[str], run_verb: "RunVerb | None") -> int:
    debug = "--debug" in arguments
    match [argument for argument in arguments if argument != "--debug"]:
        case []:
            print(overview(program), file=sys.stderr)
            return USAGE
        case ["help" | "-h" | "--help"]:
            print(overview(program))
            return 0
        case given if "--version" in given:
            return _print_version(program)
        case [flag, request] if flag in COMPLETION_FLAGS:
            from geomotion_cli.completion import complete

            return complete(program, request)
        case ["help", verb, *_] | [verb, *_] if verb not in PROGRAMS[program].verbs:
            return Reporter(program, wants_json(arguments)).report(usage_error(_unknown_verb(program, verb)))
        case ["help", verb, *_]:
            return _print_verb_help(program, verb)
        case [verb, *rest] if HELP_FLAGS.intersection(rest):
            return _print_verb_help(program, verb)
        case [verb, *rest]:
            from geomotion_cli.application import run

            return run(program, verb, rest, Reporter(f"{program} {verb}", wants_json(rest), debug), run_verb)
    raise AssertionError(arguments)


def wants_json(arguments: list[str]) -> bool:
    """Whether the last ``output=`` asks for JSON: needed for mistakes found before the configuration exists."""
    outputs = [argument for argument in arguments if argument.startswith("output=")]
    return outputs[-1:] == ["output=json"]


def _unknown_verb(program: str, verb: str) -> str:
    verbs = list(PROGRAMS[program].verbs)
    if "=" in verb:
        return f"{verb!r} comes before the verb; write {program} VERB {verb} with one of {', '.join(verbs)}."
    return f"unknown verb {verb!r}.{did_you_mean(verb, verbs)} Available: {', '.join(verbs)}."


def _print_version(program: str) -> int:
    from geomotion import __version__

    print(f"{program} {__version__}")
    return 0


def _print_verb_help(program: str, verb: str) -> int:
    from geomotion_cli.verb_help import describe

    print(describe(program, verb))
    return 0
