"""One verb as a Hydra application: compose, convert to the typed configuration, call the pipeline, publish.

Errors are told where they happen, inside the job: Hydra would wrap them, and a sweep's workers could not
send all of them back.
"""

import json
import math
import os
import re
import signal
import sys
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, NoReturn

import hydra
from hydra._internal.utils import get_args_parser
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from geomotion.config import CommandConfig, Output, plain
from geomotion.errors import Interrupted
from geomotion_cli.failures import Failure, Reporter, UsageMistake, did_you_mean, pipeline_error, usage_error
from geomotion_cli.hydra_errors import retell, unknown_setting
from geomotion_cli.streams import hydras_remark_removed, output_to_stderr

if TYPE_CHECKING:
    from geomotion.stages.commands import VerbResult

RunVerb = Callable[[str, CommandConfig, list[str]], "VerbResult"]
"""Carries out a verb with its typed configuration and the overrides that were typed."""

RUN_KEYS = ("run", "runs")
NUMBER_LIKE_ID = re.compile(r"(?<![\w./'\"])\d+e\d+(?![\w./'\"])")

Job = Callable[[DictConfig], float | None]


class JobFailed(Exception):
    """A job that has told about its failure; carries nothing but the exit status, so that workers can send it."""

    def __init__(self, exit_code: int) -> None:
        super().__init__(exit_code)
        self.exit_code = exit_code


def run(program: str, verb: str, arguments: list[str], reporter: Reporter, run_verb: RunVerb | None = None) -> int:
    """Run one verb, or a sweep of it, and return the exit status."""

    def job(config: DictConfig) -> float | None:
        return _run_job(verb, config, reporter, run_verb)

    try:
        _check_flags(arguments)
        return run_hydra(program, reporter.command, [_with_ids_as_text(argument) for argument in arguments], job)
    except JobFailed as failed:
        return failed.exit_code
    except BrokenPipeError:
        raise
    except Exception as error:
        return reporter.report(_explain_before_job(error), error)


def run_hydra(program: str, command: str, arguments: list[str], job: Job) -> int:
    """Hand `arguments` to Hydra under the name `command`; its errors are raised, not printed."""
    sys.argv = [command, *arguments]
    os.environ["HYDRA_FULL_ERROR"] = "1"
    application = hydra.main(version_base="1.3", config_path="pkg://geomotion.conf", config_name=program)
    try:
        with hydras_remark_removed():
            application(job)()
    except SystemExit as leaving:
        return int(leaving.code or 0)
    return 0


def _with_ids_as_text(argument: str) -> str:
    """Quote beginnings of run ids such as 12e45678, which Hydra would take for numbers."""
    key, equals, value = argument.partition("=")
    if key in RUN_KEYS:
        value = NUMBER_LIKE_ID.sub(r"'\g<0>'", value)
    return f"{key}{equals}{value}"


def _check_flags(arguments: list[str]) -> None:
    """Refuse unknown flags in one line, before Hydra does it in twenty."""

    def refuse(message: str) -> NoReturn:
        raise UsageMistake(f"{message}; --help shows what there is.")

    parser = get_args_parser()
    parser.error = refuse  # type: ignore[method-assign]
    known = [flag for action in parser._actions for flag in action.option_strings]
    unknown = [argument for argument in parser.parse_known_args(arguments)[1] if argument.startswith("-")]
    if unknown:
        raise UsageMistake(f"unknown flag {unknown[0]!r}.{did_you_mean(unknown[0], [*known, '--debug'])}")


def _run_job(verb: str, config: DictConfig, reporter: Reporter, run_verb: RunVerb | None) -> float | None:
    overrides = list(HydraConfig.get().overrides.task)
    if HydraConfig.get().mode is RunMode.MULTIRUN:
        reporter = replace(reporter, command=f"{reporter.command} {' '.join(overrides)}")
    try:
        settings = _typed(config)
        with output_to_stderr():
            result = (run_verb or _pipeline())(verb, settings, overrides)
        text = _as_text(result, settings.output)
    except Interrupted as error:
        raise SystemExit(reporter.report(pipeline_error(error), error)) from None  # ends a sweep, too
    except Exception as error:
        raise JobFailed(reporter.report(_explain(error), error)) from None
    print(text, flush=True)
    if result.exit_code:
        raise JobFailed(result.exit_code)
    return result.objective


def _explain(error: Exception) -> Failure:
    match error:
        case UsageMistake():
            return usage_error(str(error))
        case HydraException() | OmegaConfBaseException():
            return usage_error(retell(error))
    return pipeline_error(error)


def _explain_before_job(error: Exception) -> Failure:
    match error:
        case HydraException():  # some are OSErrors as well
            return _explain(error)
        case ValueError():  # how Hydra refuses some arguments
            return usage_error(retell(error))
        case OSError():  # its folder for jobs cannot be made
            reason = f"cannot write {error.filename}: {error.strerror}. Set tracking.root= to another folder."
            return Failure("StoreUnavailable", reason, 1)
    return _explain(error)


def _pipeline() -> RunVerb:
    """Import the pipeline; Ctrl-C ends the process meanwhile, because half-imported libraries hide the exception."""
    handler = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        from geomotion.stages.commands import run_verb
    finally:
        signal.signal(signal.SIGINT, handler)
    return run_verb


def _as_text(result: "VerbResult", output: Output) -> str:
    return json.dumps(result.document, allow_nan=False) if output is Output.json else result.text


def _typed(config: DictConfig) -> CommandConfig:
    settings = OmegaConf.to_object(config)
    assert isinstance(settings, CommandConfig)
    if foreign := _foreign_keys(settings):
        raise UsageMistake(unknown_setting(foreign[0], config))
    if key := _not_finite(plain(settings)):
        raise UsageMistake(f"{key} is or holds a number that is not finite; expected finite numbers.")
    return settings


def _not_finite(settings: Any, key: str = "") -> str:
    """The first key whose value is or holds NaN or infinity, which make no sense anywhere; empty if there is none."""
    match settings:
        case dict():
            found = (_not_finite(value, f"{key}.{name}" if key else name) for name, value in settings.items())
            return next(filter(None, found), "")
        case list():
            return key if any(_not_finite(value, key) for value in settings) else ""
        case float() if not math.isfinite(settings):
            return key
    return ""


def _foreign_keys(settings: Any, prefix: str = "") -> list[str]:
    """Keys that were added with ``+key=value`` and that nothing reads."""
    declared = {item.name for item in fields(settings)}
    foreign = [prefix + name for name in vars(settings) if name not in declared]
    for name in declared:
        value = getattr(settings, name)
        if is_dataclass(value):
            foreign += _foreign_keys(value, f"{prefix}{name}.")
    return foreign
