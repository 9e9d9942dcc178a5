"""Transports that cannot be opened because an extra is not installed."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import UrcError
from urc.registry import Table
from urc.runtime.document_tests import sample_settings
from urc.runtime.transport_chain import absent_cameras, alone, make_transports
from urc.transports.base import MissingPackage

__all__ = ["MissingPackages", "dark_videos", "missing_packages"]

_WITHOUT_EXTRA: Final = frozenset(("tcp", "udp", "ssh", "telnet", "http", "websocket"))
"""Types that need no extra; they are not built, because `urc validate` should stay fast."""


class MissingPackages(NamedTuple):
    """One message for each missing package, such as ``mqtt needs the package paho-mqtt: …``."""

    needed: tuple[str, ...]
    """Packages without which the robot cannot be opened."""
    cameras: tuple[str, ...]
    """Packages without which the robot works, but some of its cameras show no images."""

    def of(self, place: str, robot: str) -> list[str]:
        """Return the messages as whole sentences.

        Args:
            place: beginning of the messages about the robot, such as ``tello``.
            robot: end of these sentences, such as ``cannot be opened``.
        """
        return [
            *(f"{place} {robot}: {text}" for text in self.needed),
            *(f"{place} shows no video: {text}" for text in self.cameras),
        ]


def missing_packages(
    profile: Profile, settings: Mapping[str, Value], table: Table
) -> MissingPackages:
    """Return the packages that the robot's transports need and this computer lacks.

    Args:
        profile: the robot's profile.
        settings: values of the settings; a missing value is replaced by a sample, because an
            operator may enter it later.
        table: factories of transports by type.

    Other faults, such as invalid values, are left out.
    """
    values = sample_settings(profile.settings) | dict(settings)
    cameras = absent_cameras(profile.driver, values, table)
    found: list[str] = []
    for name, spec in profile.driver.transports.items():
        if spec.type in _WITHOUT_EXTRA or name in cameras:
            continue
        try:
            make_transports(alone(profile.driver, name), values, table)
        except MissingPackage as fault:
            found.append(str(fault))
        except (UrcError, ImportError):  # `urc doctor` reports a missing package of the core
            continue
    return MissingPackages(
        tuple(dict.fromkeys(found)), tuple(dict.fromkeys(map(str, cameras.values())))
    )


def dark_videos(profile: Profile, settings: Mapping[str, Value], table: Table) -> frozenset[str]:
    """Return the signals of cameras whose package is missing; they never have an image.

    Args:
        profile: the robot's profile.
        settings: values of the settings, as for `missing_packages`.
        table: factories of transports by type.
    """
    driver = profile.driver
    if not any(spec.is_camera for spec in driver.transports.values()):
        return frozenset()
    absent = absent_cameras(driver, sample_settings(profile.settings) | dict(settings), table)
    dark = (one.read.fields for one in driver.messages.values() if one.transport in absent)
    return frozenset(name for fields in dark for name in fields)
