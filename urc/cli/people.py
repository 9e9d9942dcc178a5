"""`urc people`: manage people, their roles and passphrases."""

import argparse
import sys
import time
from typing import TYPE_CHECKING

from urc.cli.arguments import duration
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
from urc.cli.passkeys import list_passkeys, remove_passkey
from urc.problems import UrcError, printable

if TYPE_CHECKING:
    from urc.access.administration import PrincipalStatus
    from urc.access.store import AccessStore

EXAMPLE = "urc people invite 'Ann Lee' --role drive@#lab"

_VALID_S = 24 * 3600.0
_LONGEST_VALID_S = 14 * 24 * 3600.0
_MOST_BYTES = 4096


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: action, roles and format."""
    add_actions(
        parser,
        _ACTIONS,
        "list; add, grant, revoke, remove, passphrase, invite or passkeys NAME; rename NAME NEW;"
        " remove-passkey NAME PASSKEY",
    )
    add_roles(
        parser,
        "add, invite, grant, revoke: watch, drive, maintain or administer; drive@cart for one"
        " robot, drive@#lab for a tag; repeatable (default for revoke: all roles)",
    )
    parser.add_argument(
        "--valid",
        metavar="DURATION",
        type=duration,
        default=_VALID_S,
        help="invite: validity of the link, such as 2h, at most 336h (default: 24h)",
    )
    parser.add_argument(
        "--address", metavar="URL", help="invite: address of the server for other devices"
    )
    add_format(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the action."""
    return run_action(_ACTIONS, arguments)


def _list(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """List the people with their roles, credentials and times of last use."""
    from urc.access.administration import overview

    words_of(arguments, "people")
    people = overview(store, time.time(), "person")
    rows = [
        {
            "id": one.principal.id,
            "name": one.principal.name,
            "roles": [str(grant) for grant in one.principal.grants],
            "has_passphrase": one.has_passphrase,
            "passkeys": one.passkeys,
            "accounts": one.accounts,
            "invited_until": iso(one.invited_until),
            "sign_ins": one.sign_ins,
            "last_use": iso(one.used_at),
            "created": iso(one.principal.created_at),
        }
        for one in people
    ]
    table = [
        (
            one.principal.name,
            roles_text(one.principal.grants),
            _credentials(one),
            str(one.sign_ins),
            local_time(one.used_at),
        )
        for one in people
    ]
    head = ("NAME", "ROLES", "CREDENTIALS", "SIGN-INS", "LAST USE")
    return show(
        rows,
        [head, *table],
        arguments,
        "no people yet: 'urc people add NAME --role drive' adds a person",
    )


def _credentials(one: "PrincipalStatus") -> str:
    if one.invited_until is not None:
        return f"invited until {local_time(one.invited_until)}"
    counts = {"passphrase": one.has_passphrase, "passkey": one.passkeys, "account": one.accounts}
    return ", ".join(name for name, count in counts.items() if count) or "none"


def _add(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """Add a person with the roles from `--role`, and print the next step."""
    (name,) = words_of(arguments, "people", "NAME")
    roles = roles_in(arguments.roles)
    if not roles:
        raise Misuse("'urc people add' requires --role")
    person = store.add("person", name, roles, now=time.time())
    record(store, "people add", name=person.name, roles=roles_text(roles))
    print(printable(f"added {person.name}: {roles_text(roles)}"))
    complain(f"next: 'urc people passphrase' or 'urc people invite' lets {person.name} sign in")
    return 0


def _roles(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """Add roles to a person, or remove roles from them."""
    return change_roles(store, "person", arguments, "people")


def _rename(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """Rename a person."""
    return rename(store, "person", arguments, "people")


def _remove(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """Remove a person and all of their devices and sign-ins."""
    return remove(store, "person", arguments, "people", ", with all sign-ins and devices")


def _passphrase(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """Set a person's passphrase, and end the person's browser sign-ins."""
    from urc.access.administration import replace_passphrase
    from urc.access.passphrases import hash_of

    (name,) = words_of(arguments, "people", "NAME")
    person = named(store, "person", name)
    kept = hash_of(_typed(person.name), name=person.name)
    ended = replace_passphrase(store, person.id, kept)
    record(store, "people passphrase", name=person.name, ended=ended)
    print(printable(f"{person.name} has a new passphrase; {ended} earlier sign-ins ended"))
    return 0


def _typed(name: str) -> str:
    """Return a passphrase, typed twice on a terminal without echo, or read from standard input."""
    if not sys.stdin.isatty():
        line = sys.stdin.buffer.readline(_MOST_BYTES)
        try:
            return line.decode().rstrip("\r\n")
        except UnicodeDecodeError:
            raise UrcError("the passphrase on standard input is not UTF-8") from None
    from getpass import getpass

    try:
        first = getpass(printable(f"New passphrase for {name}: "))
        again = getpass("Repeat the passphrase: ")
    except EOFError:
        raise UrcError("no passphrase was typed; nothing was changed") from None
    if first != again:
        raise UrcError("the two passphrases differ; nothing was changed")
    return first


def _invite(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """Print a link that lets a person choose a passphrase in a browser."""
    from urc.access.administration import invite_person
    from urc.cli.invitation_links import print_link, server_address

    (name,) = words_of(arguments, "people", "NAME")
    address = server_address(store.file.parent, arguments.address)
    if arguments.valid > _LONGEST_VALID_S:
        raise Misuse(f"--valid: expected at most 336h, found {arguments.valid / 3600:g}h")
    now = time.time()
    person, code = invite_person(
        store, name, roles_in(arguments.roles), now=now, ends_at=now + arguments.valid
    )
    record(store, "people invite", name=person.name, roles=roles_text(person.grants))
    print_link(store.file.parent, address, "join", code)
    complain(
        f"invitation for {person.name} ({roles_text(person.grants)}): works once,"
        f" valid for {minutes_of(arguments.valid)}"
    )
    return 0


_ACTIONS = {
    "list": _list,
    "add": _add,
    "grant": _roles,
    "revoke": _roles,
    "rename": _rename,
    "remove": _remove,
    "passphrase": _passphrase,
    "invite": _invite,
    "passkeys": list_passkeys,
    "remove-passkey": remove_passkey,
}
