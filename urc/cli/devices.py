"""`urc devices`: pair phones, tablets and computers, and manage them."""

import argparse
import time
from typing import TYPE_CHECKING

from urc.cli.error_report import Misuse
from urc.cli.identities import (
    add_actions,
    add_format,
    add_roles,
    change_roles,
    iso,
    local_time,
    minutes_of,
    named,
    record,
    remove,
    rename,
    roles_in,
    roles_text,
    run_action,
    show,
    words_of,
)
from urc.cli.output import complain
from urc.problems import UrcError

if TYPE_CHECKING:
    from urc.access.directory import Principal
    from urc.access.grants import Grant
    from urc.access.store import AccessStore

EXAMPLE = "urc devices pair --name 'Tablet in the lab' --role drive@#lab"

_VALID_S = 120.0
_USUAL_ROLE = "drive"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: action, roles, owner and format."""
    add_actions(
        parser,
        _ACTIONS,
        "list; pair: print a link and a QR code that pair one device within 2 minutes;"
        " grant NAME, revoke NAME, rename NAME NEW, remove NAME",
    )
    add_roles(
        parser,
        "pair, grant, revoke: watch, drive, maintain or administer; drive@cart for one robot,"
        " drive@#lab for a tag; repeatable (default: drive for pair,"
        " all roles for revoke)",
    )
    parser.add_argument(
        "--owner",
        metavar="PERSON",
        help="pair: the device belongs to this person, and always has the person's roles",
    )
    parser.add_argument(
        "--name", metavar="TEXT", help="pair: name of the device (default: chosen on the device)"
    )
    parser.add_argument(
        "--address", metavar="URL", help="pair: address of the server for other devices"
    )
    add_format(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the action."""
    return run_action(_ACTIONS, arguments)


def _list(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """List the devices with their owners, roles and times of last use."""
    from urc.access.administration import overview

    words_of(arguments, "devices")
    devices = overview(store, time.time(), "device")
    rows = [
        {
            "id": one.principal.id,
            "name": one.principal.name,
            "owner": one.owner or None,
            "roles": None if one.owner else [str(grant) for grant in one.principal.grants],
            "is_paired": one.sign_ins > 0,
            "last_use": iso(one.used_at),
            "created": iso(one.principal.created_at),
        }
        for one in devices
    ]
    table = [
        (
            one.principal.name,
            f"roles of {one.owner}" if one.owner else roles_text(one.principal.grants),
            local_time(one.used_at) if one.sign_ins else "not paired",
        )
        for one in devices
    ]
    head = ("NAME", "ROLES", "LAST USE")
    return show(
        rows, [head, *table], arguments, "no devices yet: 'urc devices pair' pairs a device"
    )


def _pair(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """Print a link for pairing one device."""
    from urc.access.administration import principal_named
    from urc.access.store import parse_name
    from urc.cli.invitation_links import server_address

    words_of(arguments, "devices")
    address = server_address(store.file.parent, arguments.address)
    if arguments.owner and arguments.roles:
        raise Misuse("use either --owner or --role: with --owner, a device has its owner's roles")
    owner = named(store, "person", arguments.owner) if arguments.owner else None
    roles = () if owner else roles_in(arguments.roles or [_USUAL_ROLE])
    name = parse_name(arguments.name) if arguments.name else ""
    if name and principal_named(store.directory(), "device", name):
        raise UrcError(f"a device already has the name {name!r}")
    invite_device(store, address, roles, name=name, owner=owner)
    return 0


def invite_device(
    store: "AccessStore",
    address: str,
    roles: "tuple[Grant, ...]",
    *,
    name: str = "",
    owner: "Principal | None" = None,
) -> None:
    """Print a link and a QR code for pairing one device.

    Args:
        store: the open store.
        address: address at which devices reach the server; "" if no server is running.
        roles: roles of the device; empty if the device has an owner.
        name: suggested name; "" lets the user choose a name on the device.
        owner: person who owns the device.
    """
    from urc.access.store import Invitation
    from urc.cli.invitation_links import print_link

    now = time.time()
    invitation = Invitation("device", name, roles, owner.id if owner else "", now + _VALID_S)
    code = store.invite(invitation, now=now)
    rights = f"roles of {owner.name}" if owner else roles_text(roles)
    record(store, "devices pair", name=name, roles=rights)
    print_link(store.file.parent, address, "pair", code)
    complain(f"pairs one device ({rights}): works once, valid for {minutes_of(_VALID_S)}")


def _roles(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """Add roles to a device, or remove roles from it."""
    return change_roles(store, "device", arguments, "devices")


def _rename(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """Rename a device."""
    return rename(store, "device", arguments, "devices")


def _remove(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """Remove a device and invalidate its key."""
    return remove(store, "device", arguments, "devices", ": this device must be paired again")


_ACTIONS = {
    "list": _list,
    "pair": _pair,
    "grant": _roles,
    "revoke": _roles,
    "rename": _rename,
    "remove": _remove,
}
