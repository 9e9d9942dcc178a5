"""`urc bundle`: pack a package with its dependencies into one file, for offline machines."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from urc.packages.install_plan import InstallPlan
    from urc.packages.signature import Signature
    from urc.packages.store import Store

EXAMPLE = "urc bundle drivers/puppet --to puppet.urcof"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: package, signing key and output file."""
    parser.add_argument(
        "package",
        metavar="PACKAGE",
        help="installed package, package name as in 'install', or folder",
    )
    parser.add_argument(
        "--to", metavar="FILE", type=Path, help="output file (default: NAME-VERSION.urcof)"
    )
    parser.add_argument(
        "--key",
        metavar="FILE",
        type=Path,
        help="signing key for packages from a folder (default: your own key, if you have one)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the bundle. The same packages always produce identical bytes."""
    from urc.cli.error_report import Misuse
    from urc.cli.packages import open_store
    from urc.packages.atomic_files import put_file
    from urc.packages.sources import make_bundle

    store = open_store()
    plan = _planned(arguments.package, store)
    lock = plan.lock
    file: Path = arguments.to or Path(f"{lock.key.name}-{lock.version}.urcof")
    if file.suffix != ".urcof":
        raise Misuse(f"{file}: the file name of a bundle must end with .urcof")
    archives = {
        pin.sha256: plan.archives.get(pin.sha256) or store.blob(pin.sha256)
        for pin in lock.packages.values()
    }
    data = make_bundle(lock.key, archives, _signatures(plan, arguments), str(file))
    put_file(file, data, file.resolve().parent)
    print(f"{file}  {len(data)} bytes, {len(archives)} packages")
    return 0


def _planned(word: str, store: "Store") -> "InstallPlan":
    """Return the packages to bundle; prefer installed versions, which have been tested."""
    from urc.cli.packages import is_path, planned
    from urc.packages.install_plan import InstallPlan
    from urc.packages.names import parse_requirement

    lock = None if is_path(word) else store.find(parse_requirement(word))
    if lock is None:
        return planned(word)
    digests = [pin.sha256 for pin in lock.packages.values()]
    found = {digest: store.signature(digest) for digest in digests}
    return InstallPlan(
        lock, {}, {}, {digest: one for digest, one in found.items() if one is not None}
    )


def _signatures(plan: "InstallPlan", arguments: argparse.Namespace) -> "dict[str, Signature]":
    """Return the signatures. Packages from a folder are signed with the user's key."""
    from urc.cli.packages import signer
    from urc.packages.names import parse_key

    found = dict(plan.signatures)
    key = signer(arguments.key) if plan.own else None
    for name, pin in plan.lock.packages.items():
        if key is not None and name in plan.own and pin.sha256 not in found:
            found[pin.sha256] = key.sign(parse_key(name), pin.version, pin.sha256)
    return found
