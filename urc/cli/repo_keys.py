"""`urc repo key` and `urc repo unsigned`: the user's key, pinned keys, and signature waivers."""

import argparse
from pathlib import Path

from urc.cli.audited import audit_packages
from urc.cli.error_report import Misuse

__all__ = ["key", "unsigned"]


def key(arguments: argparse.Namespace) -> int:
    """Create or show the user's key, list the pinned keys, or delete a pinned key."""
    from urc._folders import data_folder
    from urc.cli.packages import open_store
    from urc.packages.names import parse_key
    from urc.packages.signature import PUBLISHER, fingerprint, new_signer, read_signer

    file: Path = arguments.key or data_folder() / PUBLISHER
    match arguments.words:
        case ["new", name]:
            made = new_signer(name, file)
            print(f"{made}, in {file}: keep a private backup of this file")
        case ["show"]:
            own = read_signer(file)
            if own is None:
                raise Misuse(f"{file}: there is no key; create one with 'urc repo key new NAME'")
            print(own)
        case ["list"]:
            for name, kept in sorted(open_store().state().keys.items()):
                print(f"{name}  {fingerprint(kept)}")
        case ["forget", name]:
            with open_store().changing() as change:
                change.forget_key(parse_key(name))
            audit_packages("key forget", [name])
            print(f"deleted the pinned key of {name}; the next installation pins a new key")
        case _:
            raise Misuse("expected 'urc repo key' with new NAME, show, list or forget PACKAGE")
    return 0


def unsigned(arguments: argparse.Namespace) -> int:
    """Add, list or remove waivers for packages without a signature."""
    from urc.cli.packages import open_store
    from urc.packages.names import parse_key

    match arguments.words:
        case ["add", name]:
            with open_store().changing() as change:
                change.waive(parse_key(name))
            audit_packages("unsigned add", [name])
            print(f"{name} is accepted without a signature, until a signed version is installed")
        case ["remove", name]:
            with open_store().changing() as change:
                change.end_waiver(parse_key(name))
            audit_packages("unsigned remove", [name])
            print(f"{name} requires a signature again")
        case ["list"]:
            for name in open_store().state().waived:
                print(name)
        case _:
            raise Misuse("expected 'urc repo unsigned' with add PACKAGE, remove PACKAGE or list")
    return 0
