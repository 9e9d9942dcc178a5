"""Changes the block list in a repository's ``blocks.json``, for the maintainer's commands."""

from pathlib import Path
from secrets import token_hex

import msgspec

from urc.packages import atomic_files
from urc.packages.blocks import BLOCK_FILE_BYTES, Block, BlockFile, BlockList, sign_blocks
from urc.packages.index import INDEX, INDEX_BYTES, Index, read_index
from urc.packages.index_builder import BLOCKS, changing, head_in, write_index
from urc.packages.index_head import IndexSigner, check_key
from urc.packages.names import PackageError

__all__ = ["block", "export_blocks", "unblock"]


def block(folder: Path, new: Block, index_signer: IndexSigner | None) -> Index:
    """Add an entry to a repository's block list and sign the index; return the index.

    The new entry replaces an entry with the same subject.

    Args:
        folder: the repository's folder.
        new: the entry.
        index_signer: maintainer's signer.

    Raises:
        PackageError: the maintainer has no key, or the repository is not writable.
    """
    return _change(folder, index_signer, new.subject, (new,))


def unblock(folder: Path, subject: str, index_signer: IndexSigner | None) -> Index:
    """Remove an entry from the block list and sign the index; return the index.

    Raises:
        PackageError: no entry has this subject; for other causes, see `block`.
    """
    return _change(folder, index_signer, subject, ())


def export_blocks(folder: Path, index_signer: IndexSigner | None) -> BlockFile:
    """Return a repository's signed block list for machines without a network.

    Raises:
        PackageError: the maintainer has no key, or nothing has ever been blocked.
    """
    signer = _signer(index_signer)
    index = _index(folder)
    if index.block_list is None:
        raise PackageError(f"{folder}: this repository has never blocked a package")
    return sign_blocks(index.block_list, index.number, signer)


def _change(
    folder: Path, index_signer: IndexSigner | None, subject: str, new: tuple[Block, ...]
) -> Index:
    signer = _signer(index_signer)
    try:
        with changing(folder) as work:
            index = _index(folder)
            check_key(head_in(folder), signer)  # before any write
            old = index.block_list or BlockList(token_hex(16))
            others = tuple(one for one in old.blocks if one.subject != subject)
            if not new and len(others) == len(old.blocks):
                listed = ", ".join(one.subject for one in old.blocks) or "nothing"
                raise PackageError(f"{subject} is not blocked; blocked: {listed}")
            data = msgspec.json.encode(BlockList(old.id, (*others, *new)))
            try:  # an unreadable list would not protect clients
                msgspec.json.decode(data, type=BlockList)
            except msgspec.DecodeError as error:
                raise PackageError(f"{subject}: {error}") from None
            if len(data) > BLOCK_FILE_BYTES // 2:
                raise PackageError(f"{folder}: the list of blocked packages is too large")
            atomic_files.put_file(folder / BLOCKS, data + b"\n", work)
            return write_index(folder, index.name, index.packages, work, signer)
    except OSError as error:
        raise PackageError(f"{error.filename or folder}: {error.strerror or error}") from None


def _index(folder: Path) -> Index:
    try:
        with open(folder / INDEX, "rb") as file:
            return read_index(file.read(INDEX_BYTES + 1), str(folder / INDEX))
    except FileNotFoundError:
        raise PackageError(f"{folder}: this is not a repository: it has no {INDEX}") from None


def _signer(index_signer: IndexSigner | None) -> IndexSigner:
    if index_signer is None:
        raise PackageError(
            "clients accept only a signed list of blocked packages;"
            " create a key with 'urc repo key new NAME'"
        )
    return index_signer
