"""Write the licences of all software in the playground to its folder `licences/`.

The folder contains the text of each licence, and a page with the names, versions and licences. The
documentation page `docs/licences.md` contains the same list.
"""

import re
import shutil
import tomllib
from collections.abc import Iterator, Sequence
from html import escape
from importlib.metadata import distribution
from pathlib import Path
from typing import NamedTuple

import hatch_build
import hatch_sbom
from urc import __version__
from urc.shipped import vendored

__all__ = ["PACKAGES", "PARTS", "Part", "Shipped", "contents", "parts", "write_licences"]

ROOT = Path(__file__).resolve().parents[1]
PARTS = ROOT / "playground" / "parts.toml"
TEXTS = ROOT / "LICENSES"
NO_TEXT = "public domain"
PACKAGES = (
    "anycrc", "anyio", "attrs", "idna", "jinja2", "jmespath", "jsonschema",
    "jsonschema-specifications", "markdown-it-py", "markupsafe", "mdurl", "msgspec", "pyyaml",
    "referencing", "semver", "starlette", "typing-extensions",
)  # fmt: skip
"""Names of the Python packages that the playground contains."""
_PAGE = """\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>Licences · URC playground</title>
<link rel="stylesheet" href="../licences.css">
</head>
<body>
<main>
<h1>Licences of the playground</h1>
<p>The playground contains these packages. Each name links to the text of its licence.</p>
<table>
<thead>
<tr><th scope="col">package</th><th scope="col">version</th><th scope="col">licence</th></tr>
</thead>
<tbody>
{rows}
</tbody>
</table>
<p><a href="../">Playground</a></p>
</main>
</body>
</html>
"""


class Part(NamedTuple):
    """Software that is linked into Pyodide's files."""

    name: str
    version: str
    """"" if Pyodide's files do not state the version."""
    licence: str
    """SPDX expression, or `NO_TEXT`."""
    notice: str
    """Copyright notice."""
    marks: tuple[str, ...]
    """Strings in Pyodide's files that identify the software."""


class Shipped(NamedTuple):
    """A package in the playground, and the file with its licence text."""

    name: str
    version: str
    licence: str
    """SPDX expression, or `NO_TEXT`."""
    file: str


def parts() -> list[Part]:
    """Return the software that is linked into Pyodide's files."""
    listed = tomllib.loads(PARTS.read_text("utf-8"))["part"]
    return [
        Part(one["name"], one.get("version", ""), one["licence"], one["notice"], (*one["marks"],))
        for one in listed
    ]


def contents() -> list[Shipped]:
    """Return all software in the playground, with the versions from the lock files."""
    return [
        Shipped("URC", __version__, "MIT", "urc.txt"),
        *(Shipped(one.name, one.version, one.licence, "pyodide.txt") for one in [_pyodide()]),
        *(Shipped(one.name, one.version, one.licence, "pyodide-parts.txt") for one in parts()),
        *(Shipped(one.name, one.version, one.licence, f"{one.name}.txt") for one in _packages()),
        *(Shipped(one.name, one.version, one.licence, _file(one.name)) for one in _modules()),
    ]


def write_licences(folder: Path) -> None:
    """Write the licence texts, and the page that lists them."""
    folder.mkdir(parents=True)
    shutil.copyfile(ROOT / "LICENSE", folder / "urc.txt")
    shutil.copyfile(TEXTS / "MPL-2.0.txt", folder / "pyodide.txt")
    (folder / "pyodide-parts.txt").write_text(_parts_text(parts()), "utf-8")
    for name in PACKAGES:
        (folder / f"{name}.txt").write_text(_package_text(name), "utf-8")
    vendor = vendored()
    for one in _modules() if vendor is not None else ():
        assert vendor is not None  # noqa: S101  # for the type checker
        text = vendor / one.name / "LICENSE"
        if not text.is_file():
            text = ROOT / hatch_build.LICENCES[one.name]
        shutil.copyfile(text, folder / _file(one.name))
    rows = "\n".join(_row(one) for one in contents())
    (folder / "index.html").write_text(_PAGE.format(rows=rows), "utf-8")


def _pyodide() -> hatch_sbom.NpmPackage:
    return next(iter(hatch_sbom.npm_packages(ROOT, ["pyodide"])))


def _packages() -> Iterator[hatch_sbom.LockedPackage]:
    return (one for one in hatch_sbom.python_packages(ROOT) if one.name in PACKAGES)


def _modules() -> Iterator[hatch_sbom.NpmPackage]:
    return hatch_sbom.npm_packages(ROOT, sorted(hatch_build.VENDORED))


def _file(package: str) -> str:
    return f"{package.replace('/', '-').removeprefix('@')}.txt"


def _row(one: Shipped) -> str:
    cells = [
        f'<a href="{escape(one.file)}">{escape(one.name)}</a>',
        one.version or "–",
        one.licence,
    ]
    return f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"


def _parts_text(listed: Sequence[Part]) -> str:
    """Return each part's notice, then each licence text, without repetition."""
    lines = ["Other software in Pyodide's files:", ""]
    for one in listed:
        lines += [
            f"{one.name} {one.version}".strip(),
            f"  {one.notice}",
            f"  Licence: {one.licence}",
        ]
        lines.append("")
    for name in sorted({text for one in listed for text in _texts(one.licence)}):
        lines += ["-" * 79, name, "-" * 79, "", (TEXTS / f"{name}.txt").read_text("utf-8")]
    return "\n".join(lines)


def _texts(licence: str) -> list[str]:
    return [] if licence == NO_TEXT else re.split(r" (?:AND|OR|WITH) ", licence)


def _package_text(package: str) -> str:
    """Return the licence texts of an installed package.

    Raises:
        FileNotFoundError: the package has no licence text.
    """
    texts = [
        Path(str(file.locate())).read_text("utf-8")
        for file in distribution(package).files or ()
        if re.match(r"(LICEN[CS]E|COPYING|NOTICE)", file.name, re.IGNORECASE)
    ]
    if not texts:
        raise FileNotFoundError(f"{package} has no licence text")
    return "\n\n".join(texts)
