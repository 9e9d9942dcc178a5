"""Problems of a membership, each as one line with a hint.

Layer 4.
"""

from collections.abc import Iterator
from datetime import datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from urc._extras import missing
from urc.fleet.authority import FleetAuthority
from urc.fleet.certificates import CertificateRefused
from urc.fleet.files import AUTHORITY_FOLDER
from urc.fleet.membership import Membership, NoMembership
from urc.fleet.names import FleetError
from urc.fleet.rules_file import RULES_FILE, read_rules
from urc.problems import ProblemsError, printable

__all__ = ["membership_faults", "rules_faults"]

_PACKAGES: Final = {"zenoh": "eclipse-zenoh", "joserfc": "joserfc"}
"""Packages of the extra `fleet`, by the name of their module."""


def membership_faults(folder: Path, now: datetime) -> Iterator[str]:
    """Yield a line for each problem of the membership in a folder; nothing without a membership.

    Args:
        folder: folder of the membership.
        now: time with a time zone.
    """
    try:
        membership = Membership.load(folder)
    except NoMembership:
        return
    except FleetError as error:
        yield str(error)
    else:
        yield from _certificate_faults(membership, now)
        yield from rules_faults(folder / RULES_FILE)
    if FleetAuthority.is_in(folder / AUTHORITY_FOLDER):
        yield from _authority_faults(folder / AUTHORITY_FOLDER)
    for module, package in _PACKAGES.items():
        if find_spec(module) is None:
            yield missing("the fleet needs", package, "fleet")


def rules_faults(file: Path) -> Iterator[str]:
    """Yield a line for each mistake in a file of rules; nothing without a file."""
    try:
        read_rules(file)
    except ProblemsError as error:
        for problem in error.problems:
            hint = f"; {problem.hint}" if problem.hint else ""
            yield printable(f"{problem.headline}{hint}")


def _certificate_faults(membership: Membership, now: datetime) -> Iterator[str]:
    site = membership.site
    again = f"on site {membership.authority}, run 'urc fleet invite {site}', and join again"
    if FleetAuthority.is_in(membership.folder / AUTHORITY_FOLDER):
        again = "run 'urc fleet renew'"
    try:
        membership.check(now)
    except CertificateRefused as error:
        is_early = now < membership.certificate.starts
        yield str(error) if is_early else f"{error}; {again}"
    except FleetError as error:
        yield str(error)


def _authority_faults(folder: Path) -> Iterator[str]:
    try:
        FleetAuthority.load(folder).revocations()
    except FleetError as error:
        yield str(error)
