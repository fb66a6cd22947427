"""The text of ``PROGRAM VERB --help``: usage, usual settings, choices of every group, flags, examples."""

import textwrap

from geomotion_cli.choices import program_options
from geomotion_cli.verbs import PROGRAMS

FLAGS = {
    "--cfg job": "print every setting with its value instead of running; add --resolve to fill in references",
    "-m": "sweep: one job for each combination of comma-separated values; hydra/launcher=joblib runs them in parallel",
    "--info": "where settings come from",
    "--debug": "show the traceback of an error",
}
_WIDTH = 100


def describe(program: str, verb: str) -> str:
    """The whole help text of one verb."""
    entry = PROGRAMS[program].verbs[verb]
    sections = {
        "Settings most often changed (of all that --cfg job prints):": _table(entry.settings),
        "Choices (group=option):": _choices(program),
        "Flags:": _table(FLAGS),
        "Examples:": [f"  {program} {verb} {arguments}".rstrip() for arguments in entry.examples],
    }
    lines = [f"{program} {verb}: {entry.summary}", "", f"Usage: {program} {verb} [key=value …] [FLAGS]"]
    for title, body in sections.items():
        lines += ["", title, *body]
    return "\n".join(lines)


def _table(rows: dict[str, str]) -> list[str]:
    width = max(map(len, rows))
    return [f"  {left:<{width}}  {right}" for left, right in rows.items()]


def _choices(program: str) -> list[str]:
    return [
        textwrap.fill(f"{group} = {' | '.join(options)}", _WIDTH, initial_indent="  ", subsequent_indent="      ")
        for group, options in program_options(program).items()
    ]
