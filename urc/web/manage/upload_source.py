"""Sources of uploaded packages: bundles, archives and interface documents without a package.

Layer 5. A document without a package is wrapped in a package and is then stored, listed and removed
like any other package.
"""

from collections.abc import Sequence
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any, Final

import yaml

from urc.packages.archive import PACKAGE, write_archive
from urc.packages.lock import Lock
from urc.packages.manifest import LANGUAGE, MANIFEST
from urc.packages.names import NAME, PackageError, PackageId
from urc.packages.package import open_package
from urc.packages.sources import FileSource, open_source
from urc.problems import ProblemsError
from urc.source import DocumentLimits, parse_document

__all__ = ["given_source", "source_at"]

_DOCUMENTS: Final = (".yaml", ".yml")
_BYTES: Final = 262_144
"""Maximum size of a document uploaded outside a package, in bytes."""


def given_source(name: str, data: bytes, installed: Sequence[Lock]) -> FileSource:
    """Return the package source of an uploaded file.

    Args:
        name: file name from the browser, used for its suffix and in messages.
        data: the file's content.
        installed: installed packages. A document without a package gets an unused version number.

    Raises:
        PackageError: the file is neither a package nor an interface.
    """
    name = PurePath(name).name or "the upload"
    suffix = PurePath(name).suffix.lower()
    if suffix in _DOCUMENTS:
        return _wrapped(name, data, installed)
    with TemporaryDirectory() as folder:
        file = Path(folder, f"given{suffix}")
        file.write_bytes(data)
        try:
            source = open_source(file)
        except PackageError as error:
            raise PackageError(str(error).replace(str(file), name)) from None
    source.name = name
    return source


def source_at(path: Path, installed: Sequence[Lock]) -> FileSource:
    """Return the package source at a path on this machine, or raise `PackageError`.

    The path may be a package folder, a bundle, an archive, an interface document, or the folder of
    an interface document.
    """
    bare = path / "interface.yaml" if path.is_dir() else path
    if bare.suffix.lower() not in _DOCUMENTS or (path / MANIFEST).is_file():
        return open_source(path)
    try:
        with open(bare, "rb") as opened:
            data = opened.read(_BYTES + 1)
    except OSError as error:
        if path.is_dir():
            raise PackageError(f"{path}: found neither {MANIFEST} nor interface.yaml") from None
        raise PackageError(f"{path}: {error.strerror or error}") from None
    source = _wrapped(bare.name, data, installed)
    source.is_folder = True  # the user chose the file on this machine, so it is the user's own
    return source


def _wrapped(name: str, data: bytes, installed: Sequence[Lock]) -> FileSource:
    try:
        read: Any = parse_document(data, name, DocumentLimits(size_bytes=_BYTES)).data
    except ProblemsError as error:
        raise PackageError(str(error).strip().partition("\n")[0]) from None
    document: dict[str, Any] = read if isinstance(read, dict) else {}
    if document.get("kind") != "interface":
        raise PackageError(
            f"{name}: expected an interface; drivers, robots and widgets must be packages"
        )
    called = document.get("name")
    if not isinstance(called, str) or not NAME.fullmatch(called):
        raise PackageError(f"{name}: expected 'name' in lower-case letters, digits and '-'")
    key = PackageId("interface", called)
    before = [lock.number for lock in installed if lock.key == key]
    manifest = {
        "urc": LANGUAGE,
        "package": "interface",
        "name": called,
        "version": str(max(before).bump_patch()) if before else "0.0.1",
        "licence": str(document.get("licence") or "LicenseRef-unknown"),
        "authors": [str(document.get("author") or "unknown")],
        "summary": str(document.get("title") or called),
    }
    files = {
        MANIFEST: yaml.safe_dump(manifest, sort_keys=False, allow_unicode=True).encode(),
        "interface.yaml": data,
    }
    package = open_package(write_archive(files, PACKAGE, str(key)), str(key))
    return FileSource(name, [package], [key])
