"""`urc sign-ins`: list and end the sign-ins of browsers, devices and programs."""

import argparse
import time
from typing import TYPE_CHECKING

from urc.cli.error_report import Misuse
from urc.cli.identities import (
    add_actions,
    add_format,
    iso,
    local_time,
    record,
    run_action,
    show,
    words_of,
)
from urc.problems import UrcError, printable

if TYPE_CHECKING:
    from urc.access.directory import Directory, SignIn
    from urc.access.store import AccessStore

EXAMPLE = "urc sign-ins end --all"

_FEWEST_DIGITS = 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: action and selection."""
    add_actions(
        parser,
        _ACTIONS,
        "list; end ID…: end sign-ins by id, or by at least the first 4 digits of the id",
    )
    parser.add_argument(
        "--of",
        metavar="NAME",
        help="list, end: all sign-ins of this person, device or program; after end, a device must"
        " be paired again",
    )
    parser.add_argument(
        "--all",
        action="store_true",
        help="end: all sign-ins of people and guests; paired devices and tokens remain valid",
    )
    add_format(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the action."""
    return run_action(_ACTIONS, arguments)


def _list(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """List the sign-ins with their device, place and last use, most recently used first."""
    words_of(arguments, "sign-ins")
    directory, now = store.directory(), time.time()
    of = _principals_of(directory, arguments.of)
    found = [
        one
        for one in sorted(directory.sign_ins.values(), key=lambda one: -one.used_at)
        if not one.is_over(now) and (of is None or one.principal in of)
    ]
    rows = [
        {
            "id": one.id,
            "name": directory.principals[one.principal].name,
            "kind": directory.principals[one.principal].kind,
            "way": one.way,
            "agent": one.agent,
            "place": one.place,
            "created": iso(one.created_at),
            "last_use": iso(one.used_at),
            "ends": iso(_end(one)),
        }
        for one in found
    ]
    table = [
        (
            one.id[:8],
            directory.principals[one.principal].name,
            one.way,
            one.agent or "—",
            one.place or "—",
            local_time(one.used_at),
            local_time(_end(one)),
        )
        for one in found
    ]
    head = ("ID", "NAME", "WAY", "BROWSER", "ADDRESS", "LAST USE", "ENDS")
    return show(rows, [head, *table], arguments, "no sign-ins")


def _end(one: "SignIn") -> float | None:
    """Return the UTC time at which a sign-in ends if not used again; None if it never ends."""
    ends = [one.ends_at, None if one.idle_s is None else one.used_at + one.idle_s]
    return min((each for each in ends if each is not None), default=None)


def _close(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """End the sign-ins selected by id, by name or with `--all`."""
    from urc.access.administration import KEYS, end_sign_ins

    chosen = (bool(arguments.words), arguments.of is not None, arguments.all)
    if sum(chosen) != 1:
        raise Misuse("'urc sign-ins end' requires either ID…, --of NAME or --all")
    directory = store.directory()
    if arguments.all:
        ended = end_sign_ins(store, lambda one, _: one.way not in KEYS)
    elif arguments.of is not None:
        of = _principals_of(directory, arguments.of) or set()
        ended = end_sign_ins(store, lambda one, _: one.principal in of)
    else:
        ids = {_id_of(directory, word) for word in arguments.words}
        ended = end_sign_ins(store, lambda one, _: one.id in ids)
    whose = "all people and guests" if arguments.all else arguments.of or ", ".join(arguments.words)
    record(store, "sign-ins end", of=whose, ended=ended)
    print(printable(f"{ended} sign-in{'' if ended == 1 else 's'} ended"))
    return 0


def _principals_of(directory: "Directory", name: str | None) -> set[str] | None:
    """Return the ids of all principals called `name`; None if no name is given.

    Raises:
        UrcError: no person, device, program or guest has this name.
    """
    if name is None:
        return None
    wanted = " ".join(name.split()).casefold()
    found = {one.id for one in directory.principals.values() if one.name.casefold() == wanted}
    if not found:
        raise UrcError(f"no person, device or program has the name {name!r}")
    return found


def _id_of(directory: "Directory", word: str) -> str:
    found = [one for one in directory.sign_ins if one.startswith(word)]
    if len(word) < _FEWEST_DIGITS or len(found) != 1:
        count = "several sign-ins begin" if len(found) > 1 else "no sign-in begins"
        raise UrcError(f"{count} with {word!r}; 'urc sign-ins list' shows the ids")
    return found[0]


_ACTIONS = {"list": _list, "end": _close}
