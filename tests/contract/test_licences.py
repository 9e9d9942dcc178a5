"""The licences of what URC bundles and needs: listed, true to the packages, and up to date."""

import json
import re
from html import escape
from importlib.metadata import PackageMetadata, PackageNotFoundError, metadata
from pathlib import Path

import pytest

import hatch_build
import hatch_sbom
from scripts.licences import PAGE, page
from scripts.playground_licences import NO_TEXT, Part, contents, parts, write_licences
from scripts.playground_licences import PACKAGES as IN_PLAYGROUND

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = list(hatch_sbom.python_packages(ROOT))
MODULES = list(hatch_sbom.npm_packages(ROOT, sorted(hatch_build.VENDORED)))
KNOWN = {
    "0BSD", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "CC0-1.0", "EPL-2.0",
    "GPL-2.0-or-later", "ISC", "MIT", "MIT-0", "MIT-CMU", "OFL-1.1", "PSF-2.0",
    "TCL", "ZPL-2.1", "Zlib",
}  # fmt: skip
"""All licences among the packages. A new one needs a look at its terms before it is added here."""
COPYLEFT = {"GPL-2.0-or-later"}
CLASSIFIERS = {
    "Apache Software License": {"Apache-2.0"},
    "BSD License": {"BSD-2-Clause", "BSD-3-Clause"},
    "ISC License (ISCL)": {"ISC"},
    "MIT License": {"MIT"},
}


def parts_of(expression: str) -> set[str]:
    return set(re.split(r" (?:AND|OR|WITH) ", expression))


def told_by(said: PackageMetadata) -> set[str]:
    """Return the licences that an installed package names itself."""
    if expression := said.get("License-Expression"):
        return parts_of(expression)
    found: set[str] = set()
    for line in said.get_all("Classifier") or []:
        found |= CLASSIFIERS.get(line.rpartition(" :: ")[2], set())
    return found or parts_of(said.get("License") or "")


def test_the_page_is_up_to_date() -> None:
    assert PAGE.read_text("utf-8") == page(), "run python -m scripts.licences"


@pytest.mark.parametrize("one", PACKAGES, ids=lambda one: f"{one.name} {one.version}")
def test_a_licence_is_what_the_installed_package_says(one: hatch_sbom.LockedPackage) -> None:
    """Packages of other systems are not installed here, and have only the list."""
    assert parts_of(one.licence) <= KNOWN
    assert one.hashes
    try:
        said = metadata(one.name)
    except PackageNotFoundError:
        return
    assert parts_of(one.licence) & told_by(said), told_by(said)
    if expression := said.get("License-Expression"):
        assert parts_of(expression) == parts_of(one.licence)


def test_no_package_forces_its_licence_on_users() -> None:
    """A copyleft licence is one choice of several, or absent."""
    for one in (*PACKAGES, *MODULES):
        choices = [parts_of(choice) for choice in one.licence.split(" OR ")]
        assert any(not choice & COPYLEFT for choice in choices), one


def test_every_licence_of_the_list_belongs_to_a_locked_package() -> None:
    import tomllib

    listed = tomllib.loads((ROOT / "requirements/licences.toml").read_text("utf-8"))
    assert listed.keys() == {one.name for one in PACKAGES}


@pytest.mark.parametrize("one", MODULES, ids=lambda one: one.name)
def test_a_bundled_module_brings_the_text_of_its_licence(one: hatch_sbom.NpmPackage) -> None:
    """And is the version of the lock, under the licence of its own manifest."""
    manifest = json.loads((ROOT / "node_modules" / one.name / "package.json").read_bytes())
    assert (manifest["version"], manifest["license"]) == (one.version, one.licence)
    assert parts_of(one.licence) <= KNOWN
    files = hatch_build.VENDORED[one.name]
    assert "LICENSE" in files or one.name in hatch_build.LICENCES


PYODIDE = ROOT / "node_modules" / "pyodide"
LINKED = {"Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "LLVM-exception", "MIT", "MPL-2.0",
          "Python-2.0", "Zlib", "bzip2-1.0.6", "dtoa"}  # fmt: skip
"""All licences of what is linked into Pyodide."""


@pytest.fixture(scope="module")
def binary() -> bytes:
    """The files of Pyodide that the playground contains."""
    names = ("pyodide.asm.wasm", "pyodide.asm.mjs", "pyodide.mjs")
    return b"".join((PYODIDE / name).read_bytes() for name in names)


@pytest.mark.needs("pyodide")
@pytest.mark.parametrize("one", parts(), ids=lambda one: one.name)
def test_a_part_of_pyodide_is_in_its_files(one: Part, binary: bytes) -> None:
    """With the listed version, and under a known licence."""
    assert one.marks
    assert [mark for mark in one.marks if mark.encode() not in binary] == []
    assert not one.version or any(one.version in mark for mark in one.marks)
    assert one.licence == NO_TEXT or parts_of(one.licence) <= LINKED
    assert one.notice


@pytest.mark.needs("pyodide")
def test_pyodide_has_the_version_of_the_lock() -> None:
    """And the licence that its manifest names."""
    manifest = json.loads((PYODIDE / "package.json").read_bytes())
    named = next(one for one in contents() if one.name == "pyodide")
    assert (manifest["version"], manifest["license"]) == (named.version, named.licence)


def test_each_licence_in_the_playground_has_its_text(tmp_path: Path) -> None:
    """The page links a text for each package, with its version; no text is left over."""
    write_licences(tmp_path / "licences")
    listed = contents()
    assert {one.name for one in listed} > {*IN_PLAYGROUND, "pyodide", "CPython", "uplot"}
    page = (tmp_path / "licences" / "index.html").read_text("utf-8")
    for one in listed:
        assert len((tmp_path / "licences" / one.file).read_text("utf-8")) > 200, one
        assert f">{escape(one.name)}</a></td><td>{one.version or '–'}</td>" in page, one
    files = {file.name for file in (tmp_path / "licences").iterdir()}
    assert files == {"index.html", *(one.file for one in listed)}
    told = (tmp_path / "licences" / "pyodide-parts.txt").read_text("utf-8")
    assert [one for one in parts() if one.notice not in told] == []
