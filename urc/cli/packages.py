"""Functions shared by the package subcommands: store, repositories, confirmation and names."""

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from urc._folders import data_folder
from urc.cli.data_folder import own_folder
from urc.cli.error_report import Misuse
from urc.cli.output import complain

if TYPE_CHECKING:
    from urc.packages.index import IndexEntry
    from urc.packages.install_plan import InstallPlan
    from urc.packages.lock import Lock
    from urc.packages.names import PackageId
    from urc.packages.repositories import Repositories, Repository
    from urc.packages.signature import Signer
    from urc.packages.store import Store
    from urc.packages.update import UpdateDiff

__all__ = [
    "add_risks",
    "add_waivers",
    "installed_document",
    "is_agreed",
    "is_agreed_to",
    "is_path",
    "keep_in_use",
    "known_entries",
    "open_store",
    "planned",
    "repositories",
    "search_repositories",
    "signer",
    "used_lock",
    "waived",
]


def open_store() -> "Store":
    """Return this user's package store."""
    from urc.packages.store import Store

    return Store(own_folder() / "packages")


def repositories() -> "Repositories":
    """Return the repositories that this user has added."""
    from urc.packages.repositories import Repositories

    return Repositories(own_folder() / "packages", complain)


def known_repositories() -> "list[Repository]":
    """Return the repositories that this user has added.

    Raises:
        Misuse: the user has not added a repository.
    """
    known = repositories().all()
    if not known:
        raise Misuse("no repository is configured; add one with 'urc repo add URL'")
    return known


def installed_document(word: str) -> Path | None:
    """Return the document of the robot or driver that `word` names; None if not installed.

    If `word` contains no version, return the version in use; see
    `urc.runtime.settings_store.in_use`.
    """
    if not (data_folder() / "packages" / "state.json").is_file():
        return None
    from urc.packages.names import PackageError, parse_requirement

    try:
        required = parse_requirement(word)
    except PackageError:
        return None  # a path, for example
    from urc.runtime.settings_store import in_use

    store = open_store()
    used = in_use(data_folder() / "robots", required.name, store.installed())
    if used is not None and required.range == "*" and required.kind in ("", used.key.kind):
        return store.document(used)
    for kind in ("robot", "driver"):
        if required.kind in ("", kind) and (lock := store.find(required._replace(kind=kind))):
            return store.document(lock)
    return None


def is_path(word: str) -> bool:
    """Return whether a word is the path of a file or folder rather than a package name."""
    path = Path(word)
    is_told = path.suffix in (".urcof", ".zip") or word.startswith((".", "/", "~"))
    return is_told or (path / "package.yaml").is_file()


def planned(
    word: str, pinned: "Lock | None" = None, *, takes_withdrawn: bool = False
) -> "InstallPlan":
    """Return the install plan for a package name, file or folder, with all archives downloaded."""
    from urc.packages.install import plan_file, plan_requirement
    from urc.packages.names import parse_requirement
    from urc.packages.sources import open_source

    store, known = open_store(), repositories().all()
    if is_path(word):
        source = open_source(Path(word).expanduser())
        return plan_file(source, known, store, complain)
    if not known:
        raise Misuse("no repository is configured; add one with 'urc repo add URL'")
    required = parse_requirement(word)
    with _working(f"fetching {word}") as note:
        return plan_requirement(
            required, known, store, note, pinned, takes_withdrawn=takes_withdrawn
        )


@contextmanager
def _working(title: str) -> Iterator[Callable[[str], None]]:
    """Show a status line; the yielded function stores messages, which are printed at the end."""
    from urc.cli.progress import Progress

    notes: list[str] = []
    try:
        with Progress(title):
            yield notes.append
    finally:
        for note in notes:
            complain(note)


def known_entries() -> "list[IndexEntry]":
    """Return all package versions in the stored indexes, without network requests."""
    from urc.packages.names import PackageError

    try:
        return [entry for one in repositories().all() for entry in one.known()]
    except PackageError as error:
        complain(str(error))
        return []


RISKS_FLAG: Final = "--let-it-use-my-keys-files-and-fixed-hosts"


def add_risks(parser: argparse.ArgumentParser) -> None:
    """Declare the option that accepts packages with predefined files, keys, programs or hosts."""
    parser.add_argument(
        RISKS_FLAG,
        dest="takes_risks",
        action="store_true",
        help="also accept keys, files, programs or hosts that the package itself specifies",
    )


def add_waivers(parser: argparse.ArgumentParser) -> None:
    """Declare the option that names packages to accept without a signature."""
    parser.add_argument(
        "--allow-unsigned",
        metavar="NAME",
        action="append",
        default=[],
        help="accept the package NAME, such as drivers/puppet, without a signature; repeatable",
    )


def waived(plan: "InstallPlan", arguments: argparse.Namespace) -> "InstallPlan":
    """Return the plan with the waivers from `--allow-unsigned`; raise `PackageError` on failure."""
    from urc.packages.names import parse_requirement

    words = [parse_requirement(word) for word in arguments.allow_unsigned]
    names = (
        name
        for name, key in ((name, parse_requirement(name)) for name in plan.lock.packages)
        if any(one.name == key.name and one.kind in ("", key.kind) for one in words)
    )
    return plan._replace(waived=frozenset(names))


def is_agreed(question: str) -> bool:
    """Ask the user a yes-or-no question; raise `Misuse` if there is no terminal."""
    if not sys.stdin.isatty():
        raise Misuse("cannot ask without a terminal; use --yes to confirm in advance")
    try:
        return input(f"{question} Type yes: ").strip().lower() == "yes"
    except EOFError:
        return False


def is_agreed_to(
    difference: "UpdateDiff | None",
    risks: Sequence[str],
    arguments: argparse.Namespace,
    question: str,
) -> bool:
    """Ask the user; with `--yes`, check instead that the options accept all new permissions.

    Args:
        difference: changes from the version in use; None if there is no version to compare.
        risks: resources of this machine that the package itself specifies.
        arguments: parsed arguments with ``yes``, ``allow_more`` and ``takes_risks``.
        question: question to the user, such as ``Update it?``.
    """
    gains = difference is not None and bool(difference.gained)
    if risks:
        _warn("WARNING: the package itself specifies these resources of your machine:")
        for line in risks:
            _warn(f"  {line}")
    if arguments.yes:
        return _is_yes_enough(gains, bool(risks), arguments)
    if risks and not arguments.takes_risks and not is_agreed("Allow this?"):
        return False
    return is_agreed(f"The package gains permissions. {question}" if gains else question)


def _is_yes_enough(gains: bool, has_risks: bool, arguments: argparse.Namespace) -> bool:
    lacks = [
        *(["--allow-more"] if gains and not arguments.allow_more else []),
        *([RISKS_FLAG] if has_risks and not arguments.takes_risks else []),
    ]
    if lacks:
        what = "gains permissions" if gains else "specifies resources of this machine"
        complain(
            f"urc: the package {what}, and --yes does not accept this;"
            f" add {' '.join(lacks)}, or remove --yes to be asked"
        )
    return not lacks


def used_lock(store: "Store", key: "PackageId") -> "Lock | None":
    """Return the version of a package that dashboards use; None if no version is installed.

    If a robot and a driver have the same name, the result may have a different kind from `key`.
    """
    from urc.runtime.settings_store import DRIVEN, in_use

    installed = store.installed()
    if key.kind in DRIVEN:
        return in_use(data_folder() / "robots", key.name, installed)
    mine = [lock for lock in installed if lock.key == key]
    return max(mine, key=lambda lock: lock.number, default=None)


def keep_in_use(lock: "Lock") -> None:
    """Make dashboards use this version, even if other versions are installed."""
    from urc.runtime.settings_store import DRIVEN, pin

    if lock.key.kind in DRIVEN:
        pin(data_folder() / "robots", lock)


def _warn(line: str) -> None:
    """Print one line to standard error, in red on a terminal."""
    from urc.cli.colours import painted
    from urc.problems import printable

    print(painted(printable(line), "bad", sys.stderr), file=sys.stderr, flush=True)


def signer(file: Path | None = None) -> "Signer | None":
    """Return the key in the given file, or this user's own key; None if there is no key.

    Raises:
        Misuse: the given file does not exist.
    """
    from urc.packages.signature import PUBLISHER, read_signer

    found = read_signer(file or data_folder() / PUBLISHER)
    if found is None and file is not None:
        raise Misuse(f"{file}: this file does not exist; create a key with 'urc repo key new NAME'")
    return found


def search_repositories(words: Sequence[str], kind: str = "", *, is_json: bool = False) -> int:
    """Print the newest version of each package that matches all words; return 1 if none match."""
    from urc.cli.output import json_text
    from urc.packages.index import search
    from urc.packages.sources import merged
    from urc.problems import printable

    known = known_repositories()
    with _working("reading the repositories") as note:
        found = merged(known, note)
    hits = search([entry for some in found.values() for entry, _ in some], words, kind)
    for entry in hits:
        if is_json:
            said = {"package": str(entry.key), "version": entry.version, "summary": entry.summary}
            print(json_text({**said, "signed": entry.signed and str(entry.signed)}))
        else:
            print(printable(f"{entry}  {entry.summary}".rstrip()))
    return 0 if hits else 1
