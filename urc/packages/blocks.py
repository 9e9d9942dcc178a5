"""A repository's block list: packages that must not be used, even if they are installed.

A maintainer signs the list, either in the index or in a file for machines without a network.
"""

from typing import Annotated, Final

import msgspec

from urc.packages.index_head import IndexSigner
from urc.packages.names import PackageError, parse_key
from urc.packages.package import sha256
from urc.packages.signature import Signature
from urc.packages.versions import parse_range, parse_version

__all__ = ["BLOCK_FILE_BYTES", "Block", "BlockFile", "BlockList", "read_block_file", "sign_blocks"]

BLOCK_FILE_BYTES: Final = 4 << 20
_BLOCKS_MOST: Final = 5000
_STATEMENT: Final = "URC block list 1\n{number}\n{sha256}\n{by}\n"
_Text = Annotated[str, msgspec.Meta(max_length=500)]


class Block(msgspec.Struct, frozen=True, omit_defaults=True):
    """One entry, which blocks versions of a package, one archive, or all packages of a signer."""

    why: Annotated[str, msgspec.Meta(min_length=1, max_length=500)]
    """Reason shown to users, on one line."""
    package: str = ""
    """Package, such as ``drivers/puppet``; "" for an entry about an archive or a key."""
    versions: _Text = "*"
    """Blocked range of versions. Pre-releases within the bounds are also blocked."""
    sha256: Annotated[str, msgspec.Meta(pattern=r"\A([0-9a-f]{64})?\Z")] = ""
    """Digest of the blocked archive; "" for an entry about a package or a key."""
    key: Annotated[str, msgspec.Meta(pattern=r"\A(SHA256:[A-Za-z0-9+/]{43})?\Z")] = ""
    """Fingerprint of a key whose packages are all blocked, for example a stolen key."""

    def __post_init__(self) -> None:
        """Reject an ambiguous subject, invalid names and ranges, and hidden characters."""
        if sum(map(bool, (self.package, self.sha256, self.key))) != 1:
            raise ValueError("expected exactly one of package, sha256 and key")
        if self.package:
            parse_key(self.package)
        parse_range(self.versions)
        if not self.why.isprintable():
            raise ValueError("expected a reason on one line")

    @property
    def subject(self) -> str:
        """Subject of the entry as text: a package and its versions, an archive or a signer."""
        if self.package:
            return self.package if self.versions == "*" else f"{self.package} {self.versions}"
        return f"archive {self.sha256}" if self.sha256 else f"packages signed by {self.key}"

    def is_about(self, name: str, version: str, digest: str, signature: Signature | None) -> bool:
        """Return whether the entry blocks a version of a package.

        Args:
            name: package, such as ``drivers/puppet``.
            version: its version.
            digest: digest of the package's archive.
            signature: signature of the package's archive, or None.
        """
        if self.package:
            spanned = parse_range(self.versions).spans(parse_version(version))
            return self.package == name and spanned
        if self.sha256:
            return self.sha256 == digest
        return signature is not None and signature.fingerprint == self.key


class BlockList(msgspec.Struct, frozen=True):
    """The entries of one repository's block list."""

    id: Annotated[str, msgspec.Meta(pattern=r"\A[0-9a-f]{32}\Z")]
    """Random identifier of the list, because one maintainer may sign several repositories."""
    blocks: Annotated[tuple[Block, ...], msgspec.Meta(max_length=_BLOCKS_MOST)] = ()


class BlockFile(msgspec.Struct, frozen=True):
    """A signed block list in a file, for machines without a network."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    number: Annotated[int, msgspec.Meta(ge=0, le=1 << 53)]
    """Number of the index that contains the same list; an older list is not accepted."""
    listed: BlockList
    signature: Signature

    def to_bytes(self) -> bytes:
        """Return the content of the file with the block list."""
        return msgspec.json.format(msgspec.json.encode(self), indent=1) + b"\n"


def sign_blocks(listed: BlockList, number: int, index_signer: IndexSigner) -> BlockFile:
    """Return a block list's file, signed with the maintainer's key."""
    signer = index_signer.signer
    return BlockFile(1, number, listed, signer.signs(_statement(listed, number, signer.by)))


def read_block_file(data: bytes, where: str) -> BlockFile:
    """Return a block list with a valid signature; raise `PackageError` on failure.

    The caller decides whether to trust the signature's key.
    """
    try:
        if len(data) > BLOCK_FILE_BYTES:
            raise ValueError(f"larger than {BLOCK_FILE_BYTES >> 20} MiB")
        file = msgspec.json.decode(data, type=BlockFile)
    except (ValueError, PackageError, RecursionError) as error:
        raise PackageError(f"{where}: this is not a block list: {error}") from None
    if not file.signature.verifies(_statement(file.listed, file.number, file.signature.by)):
        raise PackageError(f"{where}: the list does not match the signature by {file.signature}")
    return file


def _statement(listed: BlockList, number: int, by: str) -> bytes:
    digest = sha256(msgspec.json.encode(listed))
    return _STATEMENT.format(number=number, sha256=digest, by=by).encode()
