"""`urc install`: install a package and its dependencies from a repository, a bundle or a folder."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from urc.cli.audited import audit_packages
from urc.cli.error_report import Misuse
from urc.cli.output import complain
from urc.cli.packages import add_risks, add_waivers
from urc.cli.update import difference_lines

if TYPE_CHECKING:
    from urc.packages.install_plan import InstallPlan
    from urc.packages.lock import Lock
    from urc.packages.store import Store
    from urc.packages.update import UpdateDiff
    from urc.runtime.isolation import PreviewWorker

EXAMPLE = "urc install drivers/puppet@^1.0"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: package and confirmation options."""
    parser.add_argument(
        "package",
        metavar="PACKAGE",
        help="NAME or drivers/NAME, optionally with @VERSION; or a bundle, an archive or a folder",
    )
    parser.add_argument("--yes", action="store_true", help="install without asking")
    parser.add_argument(
        "--allow-more",
        action="store_true",
        help="with --yes: also accept permissions that the installed version does not have",
    )
    add_risks(parser)
    add_waivers(parser)
    parser.add_argument(
        "--signed-by",
        metavar="SHA256:…",
        help="accept the package only with a signature by the key with this fingerprint",
    )
    parser.add_argument(
        "--withdrawn",
        action="store_true",
        help="also accept a withdrawn version",
    )
    parser.add_argument(
        "--lock",
        metavar="FILE",
        type=Path,
        help="install exactly the versions in this lock file; create the file if it is missing",
    )


def run(arguments: argparse.Namespace) -> int:
    """Show the permissions, ask for confirmation, and install the package."""
    from urc.cli.packages import (
        is_agreed_to,
        is_path,
        keep_in_use,
        open_store,
        planned,
        used_lock,
        waived,
    )
    from urc.packages.atomic_files import put_file
    from urc.packages.install import origin_lines
    from urc.runtime.isolation import PreviewWorker

    lock_file: Path | None = arguments.lock
    pinned = _pinned(lock_file)
    if pinned is not None and is_path(arguments.package):
        raise Misuse(
            "a lock file selects versions from repositories, so a package name is required"
        )
    plan = planned(arguments.package, pinned, takes_withdrawn=arguments.withdrawn)
    plan = waived(plan, arguments)
    store = open_store()
    with store.changing() as change:
        folder = change.stage(plan)
        if arguments.signed_by is not None:
            _check_signer(plan, arguments.signed_by)
        used = used_lock(store, plan.lock.key)
        look = PreviewWorker()
        risks = _show(plan, folder, origin_lines(plan, store), look)
        difference = _compare(used, plan, store, folder, look, risks)
        if difference is not None:
            risks = difference.risks
        if not is_agreed_to(difference, risks, arguments, "Install it?"):
            print("nothing is installed")
            return 1
        if used is not None and used.version != plan.lock.version:
            keep_in_use(used)
        change.commit(plan)
    if lock_file is not None and pinned is None:
        put_file(lock_file, plan.lock.to_bytes(), lock_file.resolve().parent)
    audit_packages("install", plan.told)
    print(f"installed {plan.lock}")
    if used is not None and (used.key, used.version) != (plan.lock.key, plan.lock.version):
        print(f"{used} remains in use, because the robot's settings select this version")
    return 0


def _check_signer(plan: "InstallPlan", fingerprint: str) -> None:
    """Raise `PackageError` unless the key with this fingerprint signed the package."""
    from urc.packages.names import PackageError

    signature = plan.signatures.get(plan.lock.packages[plan.lock.root].sha256)
    if signature is None or signature.fingerprint != fingerprint.rstrip("="):
        found = f"signed by {signature}" if signature else "not signed"
        raise PackageError(f"{plan.lock} is {found}, expected a signature by {fingerprint}")


def _pinned(file: Path | None) -> "Lock | None":
    from urc.packages.lock import read_lock

    if file is None or not file.exists():
        return None
    with open(file, "rb") as opened:
        return read_lock(opened.read(1 << 20), str(file))


def _compare(
    used: "Lock | None",
    plan: "InstallPlan",
    store: "Store",
    folder: Path,
    look: "PreviewWorker",
    risks: list[str],
) -> "UpdateDiff | None":
    """Print and return the changes from the version in use; None if no other version is in use."""
    from urc.packages.update import UpdateDiff, staged_difference
    from urc.problems import UrcError, printable

    if used is None or used.key != plan.lock.key or used == plan.lock:
        return None
    try:
        found = staged_difference(used, plan, store, folder, look)
    except UrcError as error:
        line = str(error).strip().partition("\n")[0]
        complain(f"urc install: cannot show the changes, because {used} cannot be read: {line}")
        # Unknown changes count as new permissions.
        return UpdateDiff([], ["all permissions above"], [], risks, [])
    print(f"{used} is in use. The installation makes these changes:")
    for line in difference_lines(found):
        print(printable(line))
    return found


def _show(
    plan: "InstallPlan", folder: Path, origins: list[str], look: "PreviewWorker"
) -> list[str]:
    """Print the permissions of a package; return the local resources that the package specifies."""
    from urc.packages.store import kinds_in
    from urc.problems import printable

    lock = plan.lock
    document = folder / lock.root / f"{lock.key.kind}.yaml"
    widgets = [key.name for key in kinds_in(lock, "widget")]
    seen = look(document, folder, widgets)
    for line in origins:
        print(printable(line))
    print(f"{lock} has these permissions:")
    for line in seen.permissions:
        print(printable(f"  {line}"))
    return seen.risks
