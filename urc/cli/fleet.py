"""`urc fleet`: make a fleet of several servers, invite sites and revoke them."""

import argparse
import shutil
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from urc.cli.audited import audit_access
from urc.cli.error_report import Misuse
from urc.cli.fleet_rules import fleet_rules
from urc.cli.fleet_sites import known_sites, show_sites
from urc.cli.identities import add_actions, add_format, local_time, show, words_of
from urc.cli.invitation_links import qr_lines
from urc.cli.output import complain
from urc.problems import UrcError, printable

if TYPE_CHECKING:
    from urc.fleet.authority import FleetAuthority
    from urc.fleet.membership import Membership

EXAMPLE = "urc fleet invite north-hall --address 192.168.1.20:7447"

_Action = Callable[[Path, argparse.Namespace], int]
_LONGEST_CODE = 16384
"""Maximum size of a file with a code, in bytes."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: action, addresses and files."""
    add_actions(
        parser,
        _ACTIONS,
        "status, init FLEET, invite SITE, join CODE|FILE, revoke SITE, renew, rules, or rules check"
        " NAME@SITE ROBOT",
    )
    parser.add_argument("--site", metavar="SITE", help="init: name of the authority's site")
    parser.add_argument(
        "--listen",
        metavar="HOST:PORT",
        action="append",
        default=[],
        help="init, join: address on which this site accepts other sites, such as 0.0.0.0:7447;"
        " the next port is used too; repeatable (default: no open port)",
    )
    parser.add_argument(
        "--address",
        metavar="HOST:PORT",
        action="append",
        default=[],
        help="invite: address at which the new site reaches this one; repeatable",
    )
    parser.add_argument(
        "--file", metavar="FILE", type=Path, help="invite: write the code to this file only"
    )
    parser.add_argument("--qr", action="store_true", help="invite: also show the code as a QR code")
    parser.add_argument(
        "--replace", action="store_true", help="join: leave the fleet of this data folder"
    )
    parser.add_argument(
        "--device",
        metavar="ADDRESS",
        default="",
        help="rules check: network address of the visitor's device (default: unknown)",
    )
    parser.add_argument(
        "--tag",
        metavar="TAG",
        action="append",
        default=[],
        help="rules check: tag of the robot; repeatable",
    )
    parser.add_argument(
        "--guest", action="store_true", help="rules check: the visitor has not signed in"
    )
    add_format(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the action."""
    from urc._folders import data_folder

    data = arguments.data or data_folder()
    if arguments.data and not data.is_dir() and arguments.action not in ("init", "join"):
        raise UrcError(f"{data} is not a folder; select the folder of 'urc serve'")
    return _ACTIONS[arguments.action](data, arguments)


def _init(data: Path, arguments: argparse.Namespace) -> int:
    """Make a fleet and its authority."""
    from urc.cli.data_folder import own_folder
    from urc.fleet.files import FLEET_FOLDER
    from urc.fleet.joining import make_fleet

    (name,) = words_of(arguments, "fleet", "FLEET")
    if not arguments.site:
        raise Misuse("'urc fleet init' requires --site with the name of this site")
    folder = own_folder(arguments.data) / FLEET_FOLDER
    made = make_fleet(folder, name, arguments.site, _now(), listen=arguments.listen)
    audit_access(data, "fleet init", fleet=made.fleet, site=made.site)
    print(f"made fleet {made.fleet} with site {made.site}; its authority is in {folder}")
    complain("back up the authority with 'urc backup'; without it, no site can renew or join")
    return 0


def _invite(data: Path, arguments: argparse.Namespace) -> int:
    """Print the code of an invitation."""
    from urc.fleet.names import address_of

    (site,) = words_of(arguments, "fleet", "SITE")
    if arguments.file and arguments.file.exists():
        raise UrcError(f"{arguments.file} already exists; choose another file")
    authority, own = _opened(data)
    addresses = arguments.address or [
        address_of(one) for one in own.listen if not one.startswith(("tls/0.0.0.0:", "tls/[::]:"))
    ]
    if not addresses:
        raise Misuse(
            "'urc fleet invite' requires --address HOST:PORT: the address of this site for the new"
            " one"
        )
    invitation = authority.invite(site, addresses, _now())
    code, ends = invitation.code(), local_time(invitation.certificate.ends.timestamp())
    if arguments.file:
        _write_code(arguments.file, code)
    else:
        print(code)
    if arguments.qr:
        _print_qr(code)
    audit_access(data, "fleet invite", site=site, addresses=addresses, ends=ends)
    complain(
        f"keep the code secret: until {ends}, its first user becomes site {site} of fleet"
        f" {own.fleet} with 'urc fleet join'"
    )
    return 0


def _join(data: Path, arguments: argparse.Namespace) -> int:
    """Make the membership of this site from a code."""
    from urc.cli.data_folder import own_folder
    from urc.fleet.files import FLEET_FOLDER
    from urc.fleet.invitation import SiteInvitation
    from urc.fleet.joining import join
    from urc.fleet.names import address_of

    (word,) = words_of(arguments, "fleet", "CODE|FILE")
    invitation = SiteInvitation.parse(_code(word))
    folder = own_folder(arguments.data) / FLEET_FOLDER
    now = _now()
    made = join(folder, invitation, now, listen=arguments.listen, replace=arguments.replace)
    if not made.certificate.is_invitation:
        print(f"this site already is {made.site} of fleet {made.fleet}; nothing was changed")
        return 0
    audit_access(data, "fleet join", fleet=made.fleet, site=made.site)
    places = " or ".join(map(address_of, made.connect))
    ends = local_time(made.certificate.ends.timestamp())
    print(f"joined fleet {made.fleet} as site {made.site}")
    complain(f"connect to site {made.authority} at {places} before {ends}: start 'urc serve'")
    return 0


def _revoke(data: Path, arguments: argparse.Namespace) -> int:
    """Revoke all certificates of a site."""
    (site,) = words_of(arguments, "fleet", "SITE")
    authority, own = _opened(data)
    listed = authority.revoke(site, _now())
    own.take_revocations(authority.signed_revocations())
    audit_access(data, "fleet revoke", site=site, number=listed.number)
    count = len(listed.serials[site])
    print(f"revoked site {site} ({count} certificates so far; list number {listed.number})")
    return 0


def _renew(data: Path, arguments: argparse.Namespace) -> int:
    """Renew the certificate of the authority's own site, if it is due."""
    words_of(arguments, "fleet")
    _, own = _opened(data)
    ends = local_time(own.certificate.ends.timestamp())
    print(f"the certificate of site {own.site} ends: {ends}")
    return 0


def _status(data: Path, arguments: argparse.Namespace) -> int:
    """Print the membership of this site."""
    from urc.fleet.authority import FleetAuthority
    from urc.fleet.faults import membership_faults
    from urc.fleet.files import AUTHORITY_FOLDER, FLEET_FOLDER
    from urc.fleet.membership import Membership
    from urc.fleet.names import address_of

    words_of(arguments, "fleet")
    folder = data / FLEET_FOLDER
    own = Membership.load(folder)
    faults = list(membership_faults(folder, datetime.now(UTC)))
    listen, connect = [*map(address_of, own.listen)], [*map(address_of, own.connect)]
    revoked = own.revocations()
    row = {
        "fleet": own.fleet,
        "site": own.site,
        "authority": own.authority,
        "is_authority": FleetAuthority.is_in(folder / AUTHORITY_FOLDER),
        "ends": f"{own.certificate.ends:%Y-%m-%dT%H:%M:%SZ}",
        "is_invitation": own.certificate.is_invitation,
        "listen": listen,
        "connect": connect,
        "revoked": revoked.count,
        "problems": faults,
        "sites": (sites := known_sites(data)),
    }
    ends = local_time(own.certificate.ends.timestamp())
    table = [
        ("FLEET", "SITE", "AUTHORITY", "CERTIFICATE ENDS", "LISTENS", "CONNECTS", "REVOKED"),
        (
            *(own.fleet, own.site, own.authority, ends),
            *(", ".join(listen) or "-", ", ".join(connect) or "-", str(revoked.count)),
        ),
    ]
    show([row], table, arguments, "")
    if sites and arguments.format == "text":
        show_sites(sites, arguments)
    for fault in faults:
        complain(f"urc fleet: {fault}")
    return 0


def _opened(data: Path) -> "tuple[FleetAuthority, Membership]":
    """Return the authority and its own membership, with a renewed certificate if it is due."""
    from urc.fleet.authority import FleetAuthority
    from urc.fleet.files import AUTHORITY_FOLDER, FLEET_FOLDER
    from urc.fleet.joining import renew_own
    from urc.fleet.membership import Membership

    folder = data / FLEET_FOLDER
    authority = FleetAuthority.load(folder / AUTHORITY_FOLDER)
    return authority, renew_own(authority, Membership.load(folder), _now())


def _code(word: str) -> str:
    if word == "-":
        return sys.stdin.read(_LONGEST_CODE)
    if word.startswith("urc-fleet-"):
        return word
    file = Path(word)
    try:
        with file.open("rb") as opened:
            return opened.read(_LONGEST_CODE).decode("utf-8", "replace")
    except OSError as error:
        raise UrcError(
            f"{word[:80]}: expected a code that begins with 'urc-fleet-1.', or a file with one:"
            f" {error.strerror}"
        ) from error


def _write_code(file: Path, code: str) -> None:
    from urc.fleet.files import write

    write(file, f"{code}\n".encode())
    print(printable(f"wrote the code to {file}"))


def _print_qr(code: str) -> None:
    columns = shutil.get_terminal_size().columns
    lines = list(qr_lines(code, columns))
    if not lines:
        complain(f"no QR code: it does not fit into {columns} columns; use a wider terminal")
    for line in lines:
        print(line)


def _now() -> datetime:
    """Return the time; raise `UrcError` if the clock is certainly wrong."""
    from urc.access.wrong_clock import clock_fault

    now = datetime.now(UTC)
    if fault := clock_fault(now.timestamp()):
        raise UrcError(fault)
    return now


_ACTIONS: dict[str, _Action] = {
    "status": _status,
    "init": _init,
    "invite": _invite,
    "join": _join,
    "revoke": _revoke,
    "renew": _renew,
    "rules": fleet_rules,
}
