"""`urc repo block`, `unblock` and `blocks`: the lists of packages that must not be used."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from urc.cli.audited import audit_packages
from urc.cli.error_report import Misuse

if TYPE_CHECKING:
    from urc.packages.block_store import BlockStore
    from urc.packages.blocks import Block, BlockFile
    from urc.packages.index_head import IndexSigner

_AUDITED_MOST = 20
"""Maximum number of blocked packages in one audit log entry."""

__all__ = ["block", "blocks", "unblock"]


def block(arguments: argparse.Namespace, codec: "IndexSigner | None") -> int:
    """Block packages: add an entry to a repository's block list."""
    from urc.packages import block_builder

    if not (arguments.why or "").strip():
        raise Misuse("'urc repo block' requires --why with a reason for users of the package")
    folder, entry = _entry(arguments)
    index = block_builder.block(folder, entry, codec)
    print(f"blocked {entry.subject}; the index number is now {index.number}")
    return 0


def unblock(arguments: argparse.Namespace, codec: "IndexSigner | None") -> int:
    """Unblock packages: remove an entry from a repository's block list."""
    from urc.packages import block_builder

    folder, entry = _entry(arguments)
    index = block_builder.unblock(folder, entry.subject, codec)
    print(f"{entry.subject} is no longer blocked; the index number is now {index.number}")
    return 0


def _entry(arguments: argparse.Namespace) -> "tuple[Path, Block]":
    """Return the folder and the entry from DIR PACKAGE [RANGE]; raise `Misuse` if invalid."""
    import msgspec

    from urc.packages.blocks import Block

    match arguments.words:
        case [folder, subject] if subject.startswith("SHA256:"):
            said = {"key": subject.rstrip("=")}
        case [folder, subject] if len(subject) == 64 and "/" not in subject:
            said = {"sha256": subject}
        case [folder, subject]:
            said = {"package": subject}
        case [folder, subject, versions]:
            said = {"package": subject, "versions": versions}
        case _:
            raise Misuse(
                f"'urc repo {arguments.action}' requires DIR, and PACKAGE [RANGE], the SHA-256 of"
                " an archive, or the fingerprint of a key"
            )
    try:
        return Path(folder), msgspec.convert({"why": arguments.why or "-", **said}, Block)
    except msgspec.ValidationError as error:
        raise Misuse(f"{subject}: {error}") from None


def blocks(arguments: argparse.Namespace, codec: "IndexSigner | None") -> int:
    """List, import, export or delete block lists."""
    from urc.cli.packages import open_store

    known = open_store().blocks
    match arguments.words:
        case ["list"]:
            _list(known)
        case ["import", file]:
            _import(known, Path(file), arguments.signed_by or "")
        case ["export", folder, file]:
            _export(Path(folder), Path(file), codec)
        case ["forget", key]:
            known.forget(key.rstrip("="))
            audit_packages("blocks forget", [key])
            print(
                f"deleted the block lists of {key}; a repository with this key will send its list"
                " again"
            )
        case _:
            raise Misuse(
                "expected 'urc repo blocks' with list, import FILE, export DIR FILE or forget KEY"
            )
    return 0


def _list(known: "BlockStore") -> None:
    from urc.problems import printable

    for one in known.all():
        print(printable(f"{one.maintainer}  number {one.number}, from {one.place}"))
        for entry in one.listed.blocks:
            print(printable(f"  {entry.subject}: {entry.why}"))


def _import(known: "BlockStore", file: Path, fingerprint: str) -> None:
    from urc.packages.blocks import BLOCK_FILE_BYTES, read_block_file
    from urc.problems import printable

    with open(file, "rb") as opened:
        found = read_block_file(opened.read(BLOCK_FILE_BYTES + 1), str(file))
    _check_trust(known, found, file, fingerprint.rstrip("="))
    known.keep(found.signature, found.number, found.listed, str(file.resolve()))
    subjects = [one.subject for one in found.listed.blocks]
    audit_packages("blocks import", [str(found.signature), *subjects[:_AUDITED_MOST]])
    count = len(subjects)
    print(printable(f"{file}: {count} blocked packages, signed by {found.signature}"))
    _tell_hits()


def _check_trust(known: "BlockStore", found: "BlockFile", file: Path, fingerprint: str) -> None:
    """Raise `PackageError` unless the user trusts the block list's key."""
    from urc.cli.packages import repositories
    from urc.packages.names import PackageError

    signature = found.signature
    if fingerprint and fingerprint != signature.fingerprint:
        raise PackageError(
            f"{file} is signed by {signature}, expected a signature by {fingerprint}"
        )
    trusted = {one.key for one in known.all()} | {one.key for one in repositories().all()}
    if not fingerprint and signature.key not in trusted:
        raise PackageError(
            f"{file} is signed by {signature}, a key that no known repository uses; if the"
            f" maintainer confirms the key, add --signed-by {signature.fingerprint}"
        )


def _tell_hits() -> None:
    """Print a line for each installed package that a block list blocks."""
    from urc.cli.packages import open_store
    from urc.problems import printable

    store = open_store()
    for lock in store.installed():
        for line in store.blocked(lock):
            print(printable(f"  ▲ {lock}: {line}"))


def _export(folder: Path, file: Path, codec: "IndexSigner | None") -> None:
    from urc.packages.atomic_files import put_file
    from urc.packages.block_builder import export_blocks

    made = export_blocks(folder, codec)
    put_file(file, made.to_bytes(), file.resolve().parent)
    print(f"{file}  {len(made.listed.blocks)} blocked packages, signed by {made.signature}")
