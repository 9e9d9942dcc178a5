"""The settings of the robots on a command line: `--set`, the environment, a file, defaults."""

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
    """Return, for each profile, the values of its settings and the names of those without a value.

    `--set` takes precedence over the environment, the environment over the settings file, and the
    file over the profile's default. With several profiles, a setting goes to each profile that has
    it.

    Args:
        profiles: at least one.
        arguments: with the options of `add_settings`.
        allows_any_port: whether port 0 lets the system choose.

    Raises:
        Misuse: a name that no profile has, or a text that is not a value of its type.
        ProblemsError: the same, in the settings file.
    """
    given: dict[str, str] = dict(arguments.settings)
    _warn_of_secrets(profiles, arguments)
    # A single profile gives the better hint for an unknown name.
    if len(profiles) > 1:
        for name in given:
            if not any(name in profile.settings for profile in profiles):
                raise Misuse(f"none of these robots has a setting {name!r}")
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
    """Warn once of each secret on the command line, and name the alternatives."""
    told: set[str] = arguments.__dict__.setdefault("told_secrets", set())
    for name, _ in arguments.settings:
        settings = [one.settings[name] for one in profiles if name in one.settings]
        if name not in told and any(one.is_secret for one in settings):
            told.add(name)
            complain(
                f"warning: --set {name}=… is visible to every user of this machine, in the list of"
                f" processes: use {environment_name(name)} in the environment, or a file with"
                " --settings"
            )


def complete_settings(profile: Profile, arguments: argparse.Namespace) -> dict[str, Value]:
    """Return the value of every setting; raise `Misuse` with the names of settings without one."""
    ((values, missing),) = settings_given([profile], arguments)
    if missing:
        words = " ".join(f"--set {name}=…" for name in missing)
        raise Misuse(f"{profile.name} needs {', '.join(missing)}: add {words}")
    return values


def _settings_in(
    file: str | None, profiles: Sequence[Profile], *, allows_any_port: bool
) -> dict[str, str]:
    """Return the texts of a settings file, each checked against the profiles that have it."""
    if file is None:
        return {}
    document = read_document(file)
    if not isinstance(document.data, dict):
        raise ProblemsError(
            [document.problem((), "wrong-type", "a settings file must be a mapping of name: value")]
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
        text = f"there is no setting {name!r}; there are: {known}"
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
