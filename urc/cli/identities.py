"""Functions shared by the commands for people, devices, tokens and sign-ins."""

import argparse
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from urc.cli.audited import audit_access
from urc.cli.error_report import Misuse
from urc.cli.output import complain, json_text
from urc.problems import UrcError, printable

if TYPE_CHECKING:
    from urc.access.directory import Kind, Principal
    from urc.access.grants import Grant
    from urc.access.store import AccessStore

__all__ = [
    "Action",
    "add_actions",
    "add_format",
    "add_roles",
    "change_roles",
    "ends_at",
    "iso",
    "local_time",
    "minutes_of",
    "named",
    "opened",
    "record",
    "roles_in",
    "roles_text",
    "run_action",
    "show",
    "words_of",
]

Action = Callable[["AccessStore", argparse.Namespace], int]
"""Function that runs one action of a command, such as ``add``."""
_FIRST_ACTIONS = ("add", "invite", "pair")
"""Actions that may create the data folder."""
_LONGEST_DAYS = 3650
_SPAN = re.compile(r"([0-9]{1,5})(m|h|d)")
_SECONDS = {"m": 60.0, "h": 3600.0, "d": 86400.0}


def add_actions(parser: argparse.ArgumentParser, actions: Iterable[str], text: str) -> None:
    """Declare the action, its arguments and the data folder."""
    parser.add_argument("action", metavar="ACTION", choices=tuple(actions), help=text)
    parser.add_argument("words", metavar="NAME", nargs="*", help="arguments of the action")
    parser.add_argument(
        "--data-dir",
        dest="data",
        metavar="FOLDER",
        type=Path,
        help="data folder of 'urc serve' (default: data folder of this user)",
    )


def add_roles(parser: argparse.ArgumentParser, text: str) -> None:
    """Declare the repeatable option `--role`, which contains one grant."""
    parser.add_argument("--role", dest="roles", metavar="ROLE", action="append", help=text)


def add_format(parser: argparse.ArgumentParser) -> None:
    """Declare the option `--format` of lists."""
    parser.add_argument(
        "--format",
        choices=("text", "json"),
        default="text",
        help="list: 'text' prints a table, 'json' one JSON line for each entry (default: text)",
    )


def run_action(actions: Mapping[str, Action], arguments: argparse.Namespace) -> int:
    """Open the store in the data folder, and run the action from the command line.

    Raises:
        UrcError: the action needs an existing entry, but the data folder is missing.
    """
    if arguments.data and not arguments.data.is_dir() and arguments.action not in _FIRST_ACTIONS:
        raise UrcError(f"{arguments.data} is not a folder; select the folder of 'urc serve'")
    with opened(arguments.data) as store:
        return actions[arguments.action](store, arguments)


@contextmanager
def opened(data: Path | None) -> Iterator["AccessStore"]:
    """Open the store in a data folder; create a missing store.

    Args:
        data: value of `--data-dir`; None means the default folder.
    """
    from urc.access.store import AccessStore
    from urc.cli.data_folder import own_folder

    store = AccessStore(own_folder(data))
    try:
        yield store
    finally:
        store.close()


def words_of(arguments: argparse.Namespace, verb: str, *names: str) -> list[str]:
    """Return the arguments after the action; raise `Misuse` unless there is one for each name."""
    words: list[str] = arguments.words
    if len(words) != len(names):
        wanted = " ".join(("urc", verb, arguments.action, *names))
        raise Misuse(f"expected '{wanted}', found {len(words)} of {len(names)} arguments")
    return words


def named(store: "AccessStore", kind: "Kind", name: str) -> "Principal":
    """Return the principal with this kind and name, or raise `UrcError` with a suggestion."""
    from urc.access.administration import principal_named
    from urc.cli.arguments import what_it_has

    directory = store.directory()
    found = principal_named(directory, kind, name)
    if found is None:
        known = sorted(one.name for one in directory.principals.values() if one.kind == kind)
        hint = what_it_has(name, known).replace("it has:", "known names:")
        raise UrcError(f"no {kind} has the name {name!r}; {hint}")
    return found


def roles_in(texts: Sequence[str] | None) -> tuple["Grant", ...]:
    """Return the grants from `--role`; raise `Misuse` for an unknown role or an empty scope."""
    from urc.access.grants import AccessError, parse_grant

    try:
        return tuple(dict.fromkeys(parse_grant(text) for text in texts or ()))
    except AccessError as error:
        raise Misuse(f"--role: {error}") from None


def change_roles(
    store: "AccessStore", kind: "Kind", arguments: argparse.Namespace, verb: str
) -> int:
    """Run ``grant`` or ``revoke``: add roles to a person or device, or remove roles."""
    from urc.access.administration import change_grants

    (name,) = words_of(arguments, verb, "NAME")
    roles = roles_in(arguments.roles)
    is_grant = arguments.action == "grant"
    if is_grant and not roles:
        raise Misuse(f"'urc {verb} grant' requires --role")
    found = named(store, kind, name)
    if found.owner:
        raise UrcError(f"{found.name} has the roles of its owner; change the owner's roles instead")
    missing = [str(role) for role in roles if role not in found.grants]
    if not is_grant and missing:
        raise UrcError(f"{found.name} has no role {', '.join(missing)}: {roles_text(found.grants)}")

    def changed(own: tuple["Grant", ...]) -> Iterable["Grant"]:
        if is_grant:
            return (*own, *roles)
        return [role for role in own if roles and role not in roles]

    left = change_grants(store, found.id, changed)
    record(store, f"{verb} {arguments.action}", name=found.name, roles=roles_text(left))
    print(printable(f"{found.name}: {roles_text(left)}"))
    return 0


def rename(store: "AccessStore", kind: "Kind", arguments: argparse.Namespace, verb: str) -> int:
    """Run ``rename``: rename a person or device."""
    old, new = words_of(arguments, verb, "NAME", "NEW")
    principal = named(store, kind, old)
    store.rename(principal.id, new)
    record(store, f"{verb} rename", name=principal.name, new=new)
    print(printable(f"renamed {principal.name} to {new}"))
    return 0


def remove(
    store: "AccessStore", kind: "Kind", arguments: argparse.Namespace, verb: str, result: str
) -> int:
    """Run ``remove``: remove a person, device or program; append `result` to the message."""
    (name,) = words_of(arguments, verb, "NAME")
    principal = named(store, kind, name)
    store.remove(principal.id)
    record(store, f"{verb} remove", name=principal.name)
    print(printable(f"removed {principal.name}{result}"))
    return 0


def roles_text(grants: Iterable["Grant"]) -> str:
    """Return grants as text, such as ``drive@#lab, watch``."""
    return ", ".join(map(str, grants)) or "no role"


def ends_at(text: str) -> float | None:
    """Return the UTC end time for text such as ``30d``, ``8h``, ``2027-01-31`` or ``never``.

    A date means the end of that day in local time.
    """
    if text == "never":
        return None
    found = _SPAN.fullmatch(text)
    now = time.time()
    try:
        if found:
            at = now + int(found[1]) * _SECONDS[found[2]]
        else:
            day = time.strptime(text, "%Y-%m-%d")
            at = time.mktime((day.tm_year, day.tm_mon, day.tm_mday + 1, 0, 0, 0, 0, 0, -1))
    except (ValueError, OverflowError):
        at = 0.0
    if not now < at <= now + _LONGEST_DAYS * _SECONDS["d"]:
        raise argparse.ArgumentTypeError(
            f"expected a future time like 30d, 8h, 2027-01-31 or never, found {text[:20]!r}"
        )
    return at


def local_time(at: float | None, without: str = "never") -> str:
    """Return a UTC time, given in seconds since 1970, as local time without seconds."""
    return without if at is None else time.strftime("%Y-%m-%d %H:%M", time.localtime(at))


def minutes_of(seconds: float) -> str:
    """Return a readable duration, such as ``2 minutes`` or ``24 hours``."""
    for unit, length in (("day", 86400.0), ("hour", 3600.0), ("minute", 60.0)):
        count = round(seconds / length)
        if seconds >= 2 * length or (count == 1 and seconds >= length):
            return f"{count} {unit}{'s' if count > 1 else ''}"
    return f"{seconds:.0f} seconds"


def iso(at: float | None) -> str | None:
    """Return a UTC time, given in seconds, as ISO 8601 text for JSON."""
    return None if at is None else time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(at))


def show(
    rows: Sequence[Mapping[str, object]],
    table: Sequence[Sequence[str]],
    arguments: argparse.Namespace,
    empty: str,
) -> int:
    """Print a list as a table or as JSON lines, and return 0.

    Args:
        rows: one JSON object for each entry.
        table: the header row, followed by one row of strings for each entry.
        arguments: parsed arguments, including `--format`.
        empty: message for an empty list.
    """
    if arguments.format == "json":
        for row in rows:
            print(json_text(row))
        return 0
    if not rows:
        complain(empty)
        return 0
    lines = [[printable(cell) for cell in line] for line in table]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        cells = (f"{cell:<{width}}" for cell, width in zip(line, widths, strict=True))
        print("  ".join(cells).rstrip())
    return 0


def record(store: "AccessStore", command: str, **arguments: object) -> None:
    """Write one entry to the audit log in the store's data folder."""
    audit_access(store.file.parent, command, **arguments)
