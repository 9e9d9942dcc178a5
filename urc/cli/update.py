"""`urc update`: update installed packages after showing the changes, or undo an update."""

import argparse
from typing import TYPE_CHECKING

from urc.cli.audited import audit_packages
from urc.cli.error_report import Misuse
from urc.cli.output import complain
from urc.cli.packages import add_risks, add_waivers

if TYPE_CHECKING:
    from urc.packages.install_plan import InstallPlan
    from urc.packages.lock import Lock
    from urc.packages.store import Store
    from urc.packages.update import UpdateDiff

EXAMPLE = "urc update drivers/puppet"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: packages and confirmation options."""
    parser.add_argument(
        "packages",
        metavar="NAME",
        nargs="*",
        help="packages, optionally with @RANGE (default: all installed packages)",
    )
    parser.add_argument(
        "--yes",
        action="store_true",
        help="update without asking; new permissions also require --allow-more",
    )
    parser.add_argument(
        "--allow-more", action="store_true", help="with --yes: also accept new permissions"
    )
    add_risks(parser)
    add_waivers(parser)
    parser.add_argument("--back", action="store_true", help="undo the last update of NAME")


def run(arguments: argparse.Namespace) -> int:
    """Update packages, or undo an update; return 1 after a failure."""
    if arguments.back:
        return _back(arguments)
    from urc.cli.packages import known_repositories, open_store, waived

    store, known = open_store(), known_repositories()
    code = 0
    wishes = [_installed(store, word) for word in arguments.packages] or _all(store)
    for lock, wanted in wishes:
        from urc.packages.names import PackageError
        from urc.packages.update import plan_update

        try:
            plan = plan_update(lock, known, store, complain, wanted)
            if plan is None:
                print(f"{lock} is up to date")
            elif not _update(lock, waived(plan, arguments), store, arguments):
                code = 1
        except PackageError as error:  # other packages can still be updated
            complain(f"urc update: {error}")
            code = 1
    return code


def _installed(store: "Store", word: str) -> "tuple[Lock, str]":
    """Return the installed package that `word` names, and the version range in `word`."""
    from urc.packages.names import PackageError, parse_requirement

    required = parse_requirement(word)
    lock = store.find(required._replace(range="*"))
    if lock is None:
        raise PackageError(f"{required} is not installed; install it with 'urc install {word}'")
    return lock, required.range


def _all(store: "Store") -> "list[tuple[Lock, str]]":
    """Return the newest installed version of every package."""
    newest = {lock.root: lock for lock in store.installed()}  # newest version last
    if not newest:
        print("nothing is installed")
    return [(lock, "*") for lock in newest.values()]


def _update(
    old: "Lock", plan: "InstallPlan", store: "Store", arguments: argparse.Namespace
) -> bool:
    """Show the changes, ask for confirmation, and update; return whether the user agreed."""
    from urc.cli.packages import is_agreed_to
    from urc.packages.install import origin_lines
    from urc.packages.update import staged_difference
    from urc.problems import printable
    from urc.runtime.isolation import look_apart

    with store.changing() as change:
        staged = change.stage(plan)
        difference = staged_difference(old, plan, store, staged, look_apart)
        for line in _told(old, plan, difference, origin_lines(plan, store)):
            print(printable(line))
        if not is_agreed_to(difference, difference.risks, arguments, "Update it?"):
            print(f"{old} remains installed")
            return False
        change.replace(old, plan)
    audit_packages("update", plan.told)
    print(f"updated {old.root} to {plan.lock.version}; undo with 'urc update --back {old.root}'")
    return True


def _told(
    old: "Lock", plan: "InstallPlan", difference: "UpdateDiff", origins: list[str]
) -> list[str]:
    """Return the lines that describe an update: versions, origins, permissions and sent bytes."""
    from urc.packages.update import headline

    lines = [headline(old, plan.lock)]
    lines += [f"  {line}" for line in difference.versions if not line.startswith(f"{old} → ")]
    lines += [f"  {line}" for line in origins if "kept from before" not in line]
    return lines + difference_lines(difference)


def difference_lines(difference: "UpdateDiff") -> list[str]:
    """Return the differences in permissions and sent bytes between two versions, as text."""
    lines = [f"  new permission: {line}" for line in difference.gained]
    lines += [f"  lost permission: {line}" for line in difference.lost]
    if not difference.gained:
        lines.append("  no new permissions")
    if difference.wire:
        lines += ["  on the wire:", *(f"    {line}" for line in difference.wire)]
    return lines


def _back(arguments: argparse.Namespace) -> int:
    if len(arguments.packages) != 1:
        raise Misuse("--back requires exactly one package name")
    from urc.cli.packages import open_store

    store = open_store()
    lock, _ = _installed(store, arguments.packages[0])
    with store.changing() as change:
        old = change.back(lock)
    audit_packages("restore", [old])
    print(f"{lock.root} is restored to {old.version}, the version before {lock.version}")
    return 0
