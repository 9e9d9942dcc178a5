"""Robot settings from `--set`, the environment, a file and defaults."""

import argparse
import os
from collections.abc import Iterator, Sequence

from urc.cli.error_report import Misuse
from urc.cli.output import complain
from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import Problem, ProblemsError, UrcError
from urc.runtime.settings import environment_name, parse_setting, resolve_settings
from urc.source import Document, read_document

__all__ = ["complete_settings", "settings_given"]


def settings_given(
    profiles: Sequence[Profile], arguments: argparse.Namespace, *, allows_any_port: bool = False
) -> list[tuple[dict[str, Value], tuple[str, ...]]]:
    """Return each profile's settings, and the names of its settings without a value.

    The order of precedence is `--set`, the environment, the settings file, and the profile's
    defaults. With several profiles, a setting applies to each profile that declares it.

    Args:
        profiles: the profiles whose settings are returned, at least one.
        arguments: parsed arguments with the options of `add_settings`.
        allows_any_port: whether a port may be 0, which selects a free port.

    Raises:
        Misuse: no profile declares the name, or the text is not a valid value of the setting's
            type.
        ProblemsError: the settings file contains an unknown name or an invalid value.
    """
    given: dict[str, str] = dict(arguments.settings)
    _warn_of_secrets(profiles, arguments)
    # With a single profile, the hint for an unknown name is better.
    if len(profiles) > 1:
        for name in given:
            if not any(name in profile.settings for profile in profiles):
                raise Misuse(f"no robot has a setting {name!r}")
    filed = _settings_in(arguments.settings_file, profiles, allows_any_port=allows_any_port)
    resolved = []
    for profile in profiles:
        is_alone = len(profiles) == 1
        mine = {name: text for name, text in given.items() if is_alone or name in profile.settings}
        environment = {
            environment_name(name): text for name, text in filed.items() if name in profile.settings
        }
        try:
            resolved.append(
                resolve_settings(
                    profile, mine, environment | os.environ, allows_any_port=allows_any_port
                )
            )
        except UrcError as wrong:
            raise Misuse(str(wrong)) from wrong
    return resolved


def _warn_of_secrets(profiles: Sequence[Profile], arguments: argparse.Namespace) -> None:
    """Warn once about each secret on the command line, and suggest alternatives."""
    told: set[str] = arguments.__dict__.setdefault("told_secrets", set())
    for name, _ in arguments.settings:
        settings = [one.settings[name] for one in profiles if name in one.settings]
        if name not in told and any(one.is_secret for one in settings):
            told.add(name)
            complain(
                f"warning: --set {name}=… is visible to every user of this machine in the process"
                f" list: use {environment_name(name)} in the environment, or a file with"
                " --settings"
            )


def complete_settings(profile: Profile, arguments: argparse.Namespace) -> dict[str, Value]:
    """Return a value for every setting; raise `Misuse` with the names of missing settings."""
    ((values, missing),) = settings_given([profile], arguments)
    if missing:
        words = " ".join(f"--set {name}=…" for name in missing)
        raise Misuse(f"{profile.name} needs {', '.join(missing)}: add {words}")
    return values


def _settings_in(
    file: str | None, profiles: Sequence[Profile], *, allows_any_port: bool
) -> dict[str, str]:
    """Return the values in a settings file after checking them against all profiles."""
    if file is None:
        return {}
    document = read_document(file)
    if not isinstance(document.data, dict):
        raise ProblemsError(
            [
                document.problem(
                    (), "wrong-type", "expected a settings file with lines of the form NAME: VALUE"
                )
            ]
        )
    problems: list[Problem] = []
    texts: dict[str, str] = {}
    for name, value in document.data.items():
        problems += _faults_of(document, name, value, profiles, allows_any_port)
        if value is not None:
            texts[name] = _as_text(value)
    if problems:
        raise ProblemsError(problems)
    return texts


def _faults_of(
    document: Document,
    name: str,
    value: object,
    profiles: Sequence[Profile],
    allows_any_port: bool,
) -> Iterator[Problem]:
    settings = [one.settings[name] for one in profiles if name in one.settings]
    if not settings:
        known = ", ".join(dict.fromkeys(key for one in profiles for key in one.settings)) or "none"
        text = f"unknown setting {name!r}; expected one of: {known}"
        yield document.problem((name,), "unknown-setting", text, key=True)
    elif isinstance(value, (dict, list)):
        yield document.problem((name,), "wrong-type", "expected text, a number, true or false")
    elif value is not None:
        for setting in settings:
            try:
                parse_setting(setting, _as_text(value), allows_any_port=allows_any_port)
            except UrcError as wrong:
                found = document.problem((name,), "wrong-value", str(wrong))
                yield found._replace(source="") if setting.is_secret else found


def _as_text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
