"""Transports that cannot be opened because an extra is not installed."""

from collections.abc import Mapping

from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import UrcError
from urc.registry import Table
from urc.runtime.transport_chain import make_transports
from urc.transports.base import MissingPackage

__all__ = ["missing_package"]


def missing_package(profile: Profile, settings: Mapping[str, Value], table: Table) -> str:
    """Return a message that names a robot's missing package and the command to install it.

    Args:
        profile: the robot's profile.
        settings: values of the settings; other faults, such as missing values, do not count here,
            because an operator may correct them on the robot's page.
        table: factories of transports by type.

    Returns:
        The transport's message, such as ``mqtt needs the package paho-mqtt: …``; "" if all packages
        are installed.
    """
    try:
        make_transports(profile.driver, settings, table)
    except MissingPackage as fault:
        return str(fault)
    except UrcError:
        return ""
    return ""
