"""`urc bundle`: a package and all that it needs as one file, to carry where no network is."""

import argparse
from pathlib import Path

EXAMPLE = "urc bundle drivers/puppet --to puppet.urcof"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what goes into it, and where it is written."""
    parser.add_argument(
        "package", metavar="PACKAGE", help="what is installed, a name as for 'install', or a folder"
    )
    parser.add_argument(
        "--to", metavar="FILE", type=Path, help="file to write (default: NAME-VERSION.urcof)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the bundle; the same packages give the same bytes."""
    from urc.cli.failures import Misuse
    from urc.cli.packages import is_path, open_store, planned
    from urc.packages.disk import put_file
    from urc.packages.names import parse_wish
    from urc.packages.sources import make_bundle

    word: str = arguments.package
    store = open_store()
    # What is installed is at hand, and is what somebody has tried.
    lock = None if is_path(word) else store.find(parse_wish(word))
    fetched: dict[str, bytes] = {}
    if lock is None:
        plan = planned(word)
        lock, fetched = plan.lock, plan.archives
    file: Path = arguments.to or Path(f"{lock.key.name}-{lock.version}.urcof")
    if file.suffix != ".urcof":
        raise Misuse(f"{file}: the name of a bundle ends in .urcof")
    archives = {
        pin.sha256: fetched.get(pin.sha256) or store.blob(pin.sha256)
        for pin in lock.packages.values()
    }
    data = make_bundle(lock.key, archives, str(file))
    put_file(file, data, file.resolve().parent)
    print(f"{file}  {len(data)} bytes, {len(archives)} packages")
    return 0
