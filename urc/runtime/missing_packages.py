"""Transports that cannot be opened because an extra is not installed."""

from collections.abc import Mapping
from typing import Final

from urc.model.driver import Driver
from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import UrcError
from urc.registry import Table
from urc.runtime.document_tests import sample_settings
from urc.runtime.transport_chain import make_transports
from urc.transports.base import MissingPackage

__all__ = ["missing_packages"]

_WITHOUT_EXTRA: Final = frozenset(("tcp", "udp", "ssh", "telnet", "http", "websocket"))
"""Types that need no extra; they are not built, because `urc validate` should stay fast."""


def missing_packages(
    profile: Profile, settings: Mapping[str, Value], table: Table
) -> tuple[str, ...]:
    """Return one message for each missing package, with the command that installs the package.

    Args:
        profile: the robot's profile.
        settings: values of the settings; a missing value is replaced by a sample, because an
            operator may enter it later.
        table: factories of transports by type.

    Returns:
        The transports' messages, such as ``mqtt needs the package paho-mqtt: …``; empty if all
        packages are installed. Other faults, such as invalid values, are left out.
    """
    values = sample_settings(profile.settings) | dict(settings)
    found: list[str] = []
    for name, spec in profile.driver.transports.items():
        if spec.type in _WITHOUT_EXTRA:
            continue
        try:
            make_transports(_alone(profile.driver, name), values, table)
        except MissingPackage as fault:
            found.append(str(fault))
        except (UrcError, ImportError):  # `urc doctor` reports a missing package of the core
            continue
    return tuple(dict.fromkeys(found))


def _alone(driver: Driver, name: str) -> Driver:
    """Return the driver with one transport and its tunnels, so that faults of others do not count.

    The loader has checked that tunnels are not circular.
    """
    kept = {}
    while name:
        kept[name] = driver.transports[name]
        name = kept[name].tunnel
    return driver._replace(transports=kept)
