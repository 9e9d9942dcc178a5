"""``package.yaml``: a package's manifest."""

from typing import Any, Final, NamedTuple

from urc.packages.names import KINDS, NAME, PackageError, PackageId, parse_key
from urc.packages.versions import parse_range, parse_version
from urc.problems import ProblemsError
from urc.source import Document, DocumentLimits, Path, parse_document

__all__ = ["LANGUAGE", "MANIFEST", "Manifest", "parse_manifest"]

MANIFEST: Final = "package.yaml"
LANGUAGE: Final = 1
"""Version of the document language that this release of URC supports."""
_NEEDS_MOST: Final = 64
_AUTHORS_MOST: Final = 32
_LONGEST: Final = 500
_KEYS: Final = ("urc", "package", "name", "version", "licence", "authors", "summary", "needs")
_MUST: Final = _KEYS[:6]


class Manifest(NamedTuple):
    """The validated content of ``package.yaml``."""

    key: PackageId
    version: str
    """Version according to SemVer."""
    licence: str
    """SPDX expression."""
    authors: tuple[str, ...]
    summary: str
    needs: dict[str, str]
    """Version ranges of dependencies, by package name, such as ``widgets/battery-svg``."""
    language: int

    @property
    def main(self) -> str:
        """File name of the main document, such as ``driver.yaml`` for a driver."""
        return f"{self.key.kind}.yaml"


def parse_manifest(content: bytes, file: str) -> Manifest:
    """Parse and check a manifest.

    Raises:
        PackageError: the manifest is invalid; the message contains the line number.
    """
    try:
        document = parse_document(content, file, DocumentLimits(size_bytes=65536))
    except ProblemsError as error:
        raise PackageError(str(error)) from None
    reader = _Reader(document)
    data = reader.mapping
    for key in data:
        if key not in _KEYS:
            raise reader.fault((key,), f"unknown key {key!r}; expected one of: {', '.join(_KEYS)}")
    for key in _MUST:
        if key not in data:
            raise reader.fault((), f"{key!r} is missing")
    if type(data["urc"]) is not int or data["urc"] != LANGUAGE:
        raise reader.fault(("urc",), f"expected language version {LANGUAGE}")
    return Manifest(
        PackageId(reader.kind(), reader.name()),
        reader.version(),
        reader.text("licence"),
        reader.authors(),
        reader.text("summary") if "summary" in data else "",
        reader.needs() if "needs" in data else {},
        LANGUAGE,
    )


class _Reader:
    """A reader for manifest values; its errors contain the line number."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self.mapping: dict[str, Any] = {}
        if not isinstance(document.data, dict):
            raise self.fault((), f"expected the keys: {', '.join(_MUST)}")
        self.mapping = document.data

    def fault(self, path: Path, message: str) -> PackageError:
        document = self._document
        span = (document.at(path) or document.mark).span
        where = f" {'.'.join(map(str, path))}:" if path else ""
        return PackageError(f"{document.file}:{span.line}:{span.column}:{where} {message}")

    def text(self, key: str) -> str:
        return self._text((key,), self.mapping[key])

    def _text(self, path: Path, value: object) -> str:
        if not isinstance(value, str) or not value.strip() or len(value) > _LONGEST:
            raise self.fault(path, f"expected text of 1 to {_LONGEST} characters")
        if not value.isprintable():
            raise self.fault(path, "expected text on one line, without control characters")
        return value

    def kind(self) -> str:
        if self.mapping["package"] not in KINDS:
            raise self.fault(("package",), f"expected one of {', '.join(KINDS)}")
        return str(self.mapping["package"])

    def name(self) -> str:
        name = self.mapping["name"]
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise self.fault(("name",), "expected at most 64 lower-case letters, digits and '-'")
        return name

    def version(self) -> str:
        try:
            return str(parse_version(str(self.mapping["version"])))
        except PackageError as error:
            raise self.fault(("version",), str(error)) from None

    def authors(self) -> tuple[str, ...]:
        found = self.mapping["authors"]
        if not isinstance(found, list) or not 0 < len(found) <= _AUTHORS_MOST:
            raise self.fault(("authors",), f"expected a list of 1 to {_AUTHORS_MOST} names")
        return tuple(self._text(("authors", at), one) for at, one in enumerate(found))

    def needs(self) -> dict[str, str]:
        found = self.mapping["needs"]
        if not isinstance(found, dict) or len(found) > _NEEDS_MOST:
            raise self.fault(("needs",), f"expected at most {_NEEDS_MOST} packages")
        needs: dict[str, str] = {}
        for key, wanted in found.items():
            try:
                needs[str(parse_key(str(key)))] = str(parse_range(str(wanted)))
            except PackageError as error:
                raise self.fault(("needs", key), str(error)) from None
        return needs
