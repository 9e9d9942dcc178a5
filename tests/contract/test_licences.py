"""The licences of what URC bundles and needs: listed, true to the packages, and up to date."""

import json
import re
from importlib.metadata import PackageMetadata, PackageNotFoundError, metadata
from pathlib import Path

import pytest

import hatch_build
import hatch_sbom
from scripts.licences import PAGE, page

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = list(hatch_sbom.python_packages(ROOT))
MODULES = list(hatch_sbom.npm_packages(ROOT, sorted(hatch_build.VENDORED)))
KNOWN = {
    "0BSD", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "CC0-1.0", "EPL-2.0",
    "GPL-2.0-or-later", "ISC", "MIT", "MIT-0", "MIT-CMU", "PSF-2.0", "TCL", "ZPL-2.1", "Zlib",
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
