"""The groups of a robot's settings and the setting that the result of a connection test concerns.

Layer 5. Pure. Both the groups and this setting depend on how transport options use the settings.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from urc.expressions import Template
from urc.model.driver import TransportSpec
from urc.model.profile import Profile, Setting
from urc.model.values import Value
from urc.problems import UrcError, printable
from urc.protocol.forms.topics import namespace_of
from urc.ros_names import namespace_fault
from urc.runtime.connection_cause import Cause

__all__ = [
    "CONNECTION",
    "FURTHER",
    "failed_field",
    "groups_of",
    "namespace_faults",
    "place_field",
]

CONNECTION: Final = ""
"""Group of settings for the connection to the robot."""
FURTHER: Final = "*"
"""Group of all other settings without a declared group."""
_SHOWN: Final = 80
_PLACE: Final = ("host", "url", "address", "path")
_LOGIN: Final = ("password", "key", "passphrase", "username", "user", "auth", "token", "headers")
_OPTIONS: Final[Mapping[Cause, Sequence[str]]] = {
    "refused": ("port", "url", "host"),
    "unreachable": _PLACE,
    "timeout": _PLACE,
    "name": _PLACE,
    "sign-in": _LOGIN,
    "login": _LOGIN,
    "permission": ("port", "path"),
    "device": ("port", "path", "key"),
    "tls": ("port", "url", "tls", "host"),
    "closed": ("port", "url", "host"),
    "silent": ("port", "baud", "url", "host"),
    "host-key": ("host_key", "host"),
}
"""Transport options that may explain a failed connection, keyed by cause, the most likely first."""


def groups_of(profile: Profile) -> dict[str, list[Setting]]:
    """Return a robot's settings, keyed by group, `CONNECTION` first and `FURTHER` last.

    Settings without a declared group belong to `CONNECTION` if they are hosts or ports, are used by
    a transport, or must be filled in.
    """
    used = {
        name for spec in profile.driver.transports.values() for name in _used(dict(spec.options))
    }
    groups: dict[str, list[Setting]] = {CONNECTION: []}
    further: list[Setting] = []
    for setting in profile.settings.values():
        if setting.group:
            groups.setdefault(setting.group, []).append(setting)
        elif (
            setting.type in ("host", "port")
            or setting.name in used
            or setting.is_missing(setting.default)
        ):
            groups[CONNECTION].append(setting)
        else:
            further.append(setting)
    if further:
        groups[FURTHER] = further
    return {title: settings for title, settings in groups.items() if settings}


def namespace_faults(profile: Profile, values: Mapping[str, Value]) -> dict[str, str]:
    """Return why the settings make an invalid ROS namespace, keyed by the settings in it.

    A connection test would refuse such a namespace, but settings can be stored without a test.

    Args:
        profile: profile of the robot.
        values: values of the settings; missing ones are not checked.
    """
    faults: dict[str, str] = {}
    for spec in profile.driver.transports.values():
        try:
            namespace = namespace_of(spec, values)
        except UrcError:
            continue  # a setting is missing, which the page says
        fault = namespace_fault(namespace) if namespace else ""
        if fault:
            text = f"{printable(repr(namespace))[:_SHOWN]} is not a ROS namespace: {fault}"
            faults |= dict.fromkeys(_used(spec.options.get("namespace")), text)
    return faults


def failed_field(profile: Profile, transport: str, cause: Cause) -> str:
    """Return the setting that most likely caused a failed connection; "" if unknown.

    Args:
        profile: profile of the robot.
        transport: name of the failed transport.
        cause: cause of the failure.
    """
    spec = profile.driver.transports.get(transport)
    if spec is None:
        return ""
    return _first_of(spec, _OPTIONS.get(cause, ())) or _through(profile, spec, cause)


def place_field(profile: Profile, transport: str) -> str:
    """Return the setting for the address that a transport connects to; "" if unknown.

    Args:
        profile: profile of the robot.
        transport: name of the transport.
    """
    spec = profile.driver.transports.get(transport)
    if spec is None:
        return ""
    return _first_of(spec, (*_PLACE, "port")) or (
        place_field(profile, spec.tunnel) if spec.tunnel else ""
    )


def _through(profile: Profile, spec: TransportSpec, cause: Cause) -> str:
    """Return the setting of the transport's tunnel that most likely caused a failure."""
    return failed_field(profile, spec.tunnel, cause) if spec.tunnel else ""


def _first_of(spec: TransportSpec, options: Sequence[str]) -> str:
    for option in options:
        for name in sorted(_used(spec.options.get(option))):
            return name
    return ""


def _used(option: object) -> Iterator[str]:
    """Yield the names of all settings that a transport option uses."""
    if isinstance(option, Template):
        yield from option.settings
    elif isinstance(option, Mapping):
        for one in option.values():
            yield from _used(one)
    elif isinstance(option, (list, tuple)):
        for one in option:
            yield from _used(one)
