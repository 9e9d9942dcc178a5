"""Conversion of an operator's settings from text to typed values.

Every `urc` command that connects to a robot uses this module. The module does not need a network or
an event loop.
"""

import math
import re
from collections.abc import Mapping
from difflib import get_close_matches
from ipaddress import ip_address
from pathlib import Path
from types import MappingProxyType
from typing import Final

from urc._environment import SETTING
from urc.expressions import ExpressionError, Template
from urc.model.driver import TransportSpec
from urc.model.profile import Profile, Setting
from urc.model.values import Value
from urc.problems import UrcError, printable
from urc.protocol.forms.json_text import filled

__all__ = ["environment_name", "options_of", "parse_setting", "resolve_settings"]

_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")
_HOST_LABEL = re.compile(r"(?!-)[A-Za-z0-9_-]{1,63}(?<!-)")
_TRUE, _FALSE = ("true", "yes", "on", "1"), ("false", "no", "off", "0")
_ONE_SETTING = re.compile(r"\{\{\s*settings\.[a-z]\w*\s*\}\}")
_LEFT_OUT: Final = object()
_LONGEST = 4096
"""Maximum length of a setting, in characters."""
_NO_ENVIRONMENT: Mapping[str, str] = MappingProxyType({})


def environment_name(name: str) -> str:
    """Return a setting's environment variable: ``URC_SET_ROBOT_HOST`` for ``robot-host``."""
    return SETTING + name.upper().replace("-", "_")


def resolve_settings(
    profile: Profile,
    given: Mapping[str, str],
    environ: Mapping[str, str] = _NO_ENVIRONMENT,
    *,
    allows_any_port: bool = False,
) -> tuple[dict[str, Value], tuple[str, ...]]:
    """Return the value of each setting, and the names of the settings that have no value.

    Args:
        profile: profile with the settings.
        given: values from ``--set`` as text, by setting name; they override all other sources.
        environ: environment variables; ``URC_SET_NAME`` overrides the default of a setting.
        allows_any_port: whether to permit port 0, for a server that lets the system choose.

    Raises:
        UrcError: a name is unknown, or a value is invalid.
    """
    for name in given:
        if name not in profile.settings:
            raise UrcError(_unknown(name, profile))
    values: dict[str, Value] = {}
    for name, setting in profile.settings.items():
        text = given.get(name)
        source = f"--set {name}"
        if text is None:
            source = environment_name(name)
            text = environ.get(source)
        if text is None:
            values[name] = setting.default
        else:
            try:
                values[name] = parse_setting(setting, text, allows_any_port=allows_any_port)
            except UrcError as problem:
                raise UrcError(f"{source}: {problem}") from problem
    for name, setting in profile.settings.items():
        if values[name] is None and not setting.is_required:
            values[name] = setting.empty
    specs = profile.settings
    missing = tuple(name for name in values if values[name] is None and specs[name].is_required)
    return {name: value for name, value in values.items() if name not in missing}, missing


def parse_setting(setting: Setting, text: str, *, allows_any_port: bool = False) -> Value:
    """Convert `text` to the type of `setting` and return the value.

    Args:
        setting: setting with a type and a range.
        text: text from the operator.
        allows_any_port: whether to permit port 0, for a server that lets the system choose.

    Raises:
        UrcError: the text is invalid; the message shows the actual and the expected value. Secret
            values are not shown in the message.
    """
    if len(text) > _LONGEST:
        raise UrcError(f"is {len(text)} characters long; at most {_LONGEST} are allowed")
    if not setting.is_required and not text.strip():
        return setting.empty
    found = "that" if setting.is_secret else repr(text)
    match setting.type:
        case "string":
            return _text(text, found)
        case "host":
            return _host(text, found)
        case "port":
            low = 0 if allows_any_port else 1
            return _integer(text, found, low=low, high=65535, kind="a port")
        case "integer":
            return _integer(text, found, setting.min, setting.max)
        case "number":
            return _number(text, found, setting)
        case "boolean":
            return _boolean(text, found)
        case "choice":
            return _choice(setting, text, found)
        case "path":
            return _path(text, found)


def options_of(spec: TransportSpec, settings: Mapping[str, Value]) -> dict[str, object]:
    """Return a transport's options, with templates evaluated over ``settings``.

    An option is omitted if its template contains only a setting, and the setting is empty.

    Raises:
        UrcError: a template uses a missing setting or fails.
    """
    options: dict[str, object] = {}
    for name, option in spec.options.items():
        try:
            value = _filled(option, settings)
        except ExpressionError as problem:
            raise UrcError(f"transports.{spec.name}.{name}: {problem}") from problem
        if value is not _LEFT_OUT:
            options[name] = value
    return options


def _filled(option: object, settings: Mapping[str, Value]) -> object:
    if isinstance(option, Mapping):
        found = {name: _filled(inner, settings) for name, inner in option.items()}
        return {name: value for name, value in found.items() if value is not _LEFT_OUT}
    value = filled(option, {"settings": settings})
    is_setting = isinstance(option, Template) and _ONE_SETTING.fullmatch(option.source.strip())
    return _LEFT_OUT if is_setting and value in (None, "") else value


def _text(text: str, found: str) -> str:
    # The environment and the command line may contain undecodable bytes; no robot accepts them.
    if any("\ud800" <= character <= "\udfff" for character in text):
        raise UrcError(f"{found} is not valid UTF-8 text")
    return text


def _path(text: str, found: str) -> str:
    if not text.strip() or "\0" in text:
        raise UrcError(f"{found} is not a path")
    try:
        return str(Path(text).expanduser())
    except RuntimeError as error:  # ~ without a home folder, or of an unknown user
        raise UrcError(f"{found} is not a path: its home folder is unknown") from error


def _host(text: str, found: str) -> str:
    name = text.strip()
    bare = name[1:-1] if name.startswith("[") and name.endswith("]") else name
    try:
        ip_address(bare)
    except ValueError:
        labels = name.removesuffix(".").split(".")
        looks_numeric = all(label.isdigit() for label in labels)
        if len(name) > 253 or looks_numeric or not all(map(_HOST_LABEL.fullmatch, labels)):
            raise UrcError(f"{found} is not a host name or an address") from None
        return name
    return bare


def _integer(
    text: str, found: str, low: float | None, high: float | None, kind: str = "a whole number"
) -> int:
    if not _INTEGER.fullmatch(text.strip()) or not _is_within(int(text), low, high):
        raise UrcError(f"{found} is not {kind}{_between(low, high)}")
    return int(text)


def _number(text: str, found: str, setting: Setting) -> float:
    low, high = setting.min, setting.max
    is_number = _NUMBER.fullmatch(text.strip()) and math.isfinite(float(text))
    if not is_number or not _is_within(float(text), low, high):
        raise UrcError(f"{found} is not a number{_between(low, high)}")
    return float(text)


def _boolean(text: str, found: str) -> bool:
    word = text.strip().lower()
    if word not in _TRUE + _FALSE:
        raise UrcError(f"{found} is neither true nor false")
    return word in _TRUE


def _choice(setting: Setting, text: str, found: str) -> str:
    if text not in setting.choices:
        raise UrcError(f"{found} is not one of {', '.join(setting.choices)}")
    return text


def _is_within(number: float, low: float | None, high: float | None) -> bool:
    return (low is None or number >= low) and (high is None or number <= high)


def _between(low: float | None, high: float | None) -> str:
    if low is not None and high is not None:
        return f" from {low:.15g} to {high:.15g}"
    if low is not None:
        return f" of at least {low:.15g}"
    if high is not None:
        return f" of at most {high:.15g}"
    return ""


def _unknown(name: str, profile: Profile) -> str:
    close = get_close_matches(name, profile.settings, n=1)
    if close:
        hint = f"; did you mean {close[0]!r}?"
    elif profile.settings:
        hint = f"; it has {', '.join(profile.settings)}"
    else:
        hint = "; it has none"
    return f"{profile.name} has no setting {printable(repr(name))}{hint}"
