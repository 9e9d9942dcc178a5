"""Write docs/licences.md from the lock files.

python -m scripts.licences           write the page
python -m scripts.licences --check   exit 1 if the page is outdated
"""

import sys
from collections.abc import Iterable
from pathlib import Path

import hatch_build
import hatch_sbom

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "licences.md"
_HEAD = """\
# Licences

Made by `python -m scripts.licences` from the lock files.
The wheel contains the same lists with hashes, as [CycloneDX](https://cyclonedx.org/) JSON. \
The path in the wheel is `urc-*.dist-info/sboms/urc.cdx.json` ([PEP 770](https://peps.python.org/pep-0770/)).

URC itself has the licence MIT; see [LICENSE](../LICENSE). \
The shipped robots, widgets, templates and schemas are parts of URC.
"""
_MODULES = "The wheel contains files of these packages in `urc_vendor/`, with their licence texts."
_PACKAGES = """\
The wheel does not contain these packages. \
An installation of URC needs them; `./dev demo` installs exactly these versions. \
Packages marked with “extra” are needed for cameras and laser scanners of emulated robots only.
"""


def page() -> str:
    """Return the page's text."""
    modules = hatch_sbom.npm_packages(ROOT, sorted(hatch_build.VENDORED))
    packages = hatch_sbom.python_packages(ROOT)
    parts = [
        _HEAD,
        "## Bundled browser modules\n",
        f"{_MODULES}\n",
        _table((one.name, one.version, one.licence) for one in modules),
        "## Python packages\n",
        _PACKAGES,
        _table((_named(one), _version(one), one.licence) for one in packages),
    ]
    return "\n".join(parts)


def _table(rows: Iterable[tuple[str, str, str]]) -> str:
    lines = ["| package | version | licence |", "|---|---|---|"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows), ""])


def _named(one: hatch_sbom.LockedPackage) -> str:
    return f"{one.name} (extra `demo`)" if one.is_optional else one.name


def _version(one: hatch_sbom.LockedPackage) -> str:
    """Return the version; if there are several versions, add the range of Python versions."""
    if not one.marker.startswith("python_full_version") or " and " in one.marker:
        return one.version
    return f"{one.version} (Python {one.marker.removeprefix('python_full_version ')})"


def main(arguments: list[str]) -> int:
    """Write or check the page; return the exit code."""
    if "--check" in arguments:
        is_new = PAGE.is_file() and PAGE.read_text("utf-8") == page()
        if not is_new:
            print("docs/licences.md is outdated: run python -m scripts.licences", file=sys.stderr)
        return 0 if is_new else 1
    PAGE.write_text(page(), "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
