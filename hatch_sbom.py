"""The software bill of materials (SBOM) of a wheel, as CycloneDX JSON for `.dist-info/sboms/`.

The SBOM lists the vendored browser modules with each of their files. The SBOM also lists the Python
packages that the wheel needs, in the tested versions. The same sources produce the same
bytes, so the SBOM contains neither the time of the build nor a random number.

The build uses the standard library only: a library for CycloneDX would be one more package to trust
at each build. The wheel test validates the result against the official schema.
"""

import base64
import hashlib
import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

__all__ = ["LOCK", "SBOM", "LockedPackage", "NpmPackage", "npm_packages", "python_packages", "sbom"]

SBOM = "urc.cdx.json"
LOCK = "requirements/demo.txt"
_LICENCES = "requirements/licences.toml"
_FORMAT = "1.6"
_PIN = re.compile(r"^([a-z0-9][a-z0-9._-]*)==([^\s;\\]+)(?: ; ([^\\\n]+?))? \\$", re.MULTILINE)
_NAME = re.compile(r"[a-z0-9-]+")
_HASH = re.compile(r"--hash=sha256:([0-9a-f]{64})")


class LockedPackage(NamedTuple):
    """A Python package in the lock file, with one locked version."""

    name: str
    version: str
    marker: str
    """Environments that use this version, as a PEP 508 marker; "" for all environments."""
    licence: str
    """SPDX expression."""
    hashes: tuple[str, ...]
    """SHA-256 of each file of this version, in hex digits."""
    is_optional: bool
    """Whether only the extra `demo` needs the package."""


class NpmPackage(NamedTuple):
    """A vendored package of browser modules."""

    name: str
    version: str
    licence: str
    """SPDX expression."""
    sha512: str
    """SHA-512 of the package's npm archive, in hex digits."""


def python_packages(root: Path) -> Iterator[LockedPackage]:
    """Yield the packages in the lock file; raise `KeyError` for a package without a licence."""
    licences: dict[str, str] = tomllib.loads((root / _LICENCES).read_text("utf-8"))
    project = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["project"]
    extra = {_NAME.match(one)[0] for one in project["optional-dependencies"]["demo"]}  # type: ignore[index]  # each begins with a name
    text = (root / LOCK).read_text("utf-8")
    heads = list(_PIN.finditer(text))
    ends = [*(head.start() for head in heads[1:]), len(text)]
    for head, end in zip(heads, ends, strict=True):
        name, version, marker = head.groups(default="")
        hashes = tuple(_HASH.findall(text[head.end() : end]))
        yield LockedPackage(name, version, marker, licences[name], hashes, name in extra)


def npm_packages(root: Path, names: list[str]) -> Iterator[NpmPackage]:
    """Yield the vendored packages with the hashes of npm's lock file."""
    locked = json.loads((root / "package-lock.json").read_text("utf-8"))["packages"]
    for name in names:
        found = locked[f"node_modules/{name}"]
        algorithm, _, digest = found["integrity"].partition("-")
        if algorithm != "sha512":
            raise ValueError(f"{name}: expected an SHA-512 in package-lock.json, found {algorithm}")
        sha512 = base64.b64decode(digest).hex()
        yield NpmPackage(name, found["version"], found["license"], sha512)


def sbom(root: Path, vendor: Path, version: str, names: list[str]) -> bytes:
    """Return the SBOM of a wheel as JSON bytes.

    Args:
        root: folder of the sources, with the lock files.
        vendor: folder of the vendored modules, one folder for each package.
        version: version of URC.
        names: names of the vendored packages.
    """
    modules = [_module(one, vendor) for one in npm_packages(root, names)]
    packages = [_package(one) for one in python_packages(root)]
    urc = f"pkg:pypi/urc@{version}"
    needed = [one["bom-ref"] for one in (*modules, *packages)]
    said = {
        "$schema": f"http://cyclonedx.org/schema/bom-{_FORMAT}.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": _FORMAT,
        "version": 1,
        "metadata": {
            "lifecycles": [{"phase": "build"}],
            "component": {
                "type": "application",
                "bom-ref": urc,
                "name": "urc",
                "version": version,
                "purl": urc,
                "licenses": [{"expression": "MIT"}],
            },
        },
        "components": [*modules, *packages],
        "dependencies": [{"ref": urc, "dependsOn": needed}, *({"ref": one} for one in needed)],
    }
    return json.dumps(said, indent=1, ensure_ascii=False).encode() + b"\n"


def _module(one: NpmPackage, vendor: Path) -> dict[str, Any]:
    """Return the SBOM component of a vendored package, with its files as subcomponents."""
    home = vendor / one.name
    ref = f"pkg:npm/{quote(one.name, safe='/')}@{one.version}"
    files = sorted(file for file in home.rglob("*") if file.is_file())
    return {
        "type": "library",
        "bom-ref": ref,
        "name": one.name,
        "version": one.version,
        "purl": ref,
        "scope": "required",
        "licenses": [{"expression": one.licence}],
        "hashes": [{"alg": "SHA-512", "content": one.sha512}],
        "properties": [{"name": "urc:bundled", "value": "true"}],
        "components": [
            {
                "type": "file",
                "bom-ref": f"{ref}#{quote(file.relative_to(home).as_posix())}",
                "name": f"urc_vendor/{file.relative_to(vendor).as_posix()}",
                "hashes": [
                    {"alg": "SHA-256", "content": hashlib.sha256(file.read_bytes()).hexdigest()}
                ],
            }
            for file in files
        ],
    }


def _package(one: LockedPackage) -> dict[str, Any]:
    """Return the SBOM component of a Python package, with the hashes of all its files."""
    ref = f"pkg:pypi/{one.name}@{one.version}"
    marker = [{"name": "urc:marker", "value": one.marker}] if one.marker else []
    return {
        "type": "library",
        "bom-ref": ref,
        "name": one.name,
        "version": one.version,
        "purl": ref,
        "scope": "optional" if one.is_optional else "required",
        "licenses": [{"expression": one.licence}],
        "hashes": [{"alg": "SHA-256", "content": digest} for digest in one.hashes],
        "properties": [{"name": "urc:bundled", "value": "false"}, *marker],
    }
