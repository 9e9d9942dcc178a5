"""Find missing values that only a publisher of URC can fill in; see docs/project/publication.md.

A release can be built without these values, so `./dev release` prints the missing values and
continues.
"""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

__all__ = ["PAGE", "URLS", "missing_values"]

PAGE = "docs/project/publication.md"
URLS = ("Source", "Documentation", "Issues", "Changelog")
"""Labels of project URLs that package indexes recognise."""
_INSTALL = "docs/install/index.md"
_NOT_IN_INDEX = "not yet on the Python package index"


def missing_values(root: Path, version: str) -> Iterator[str]:
    """Yield a line for each missing value, with its file and the reason.

    Args:
        root: root folder of the source tree.
        version: URC version to be published.
    """
    project = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["project"]
    if names := [name for name in URLS if name not in project.get("urls", {})]:
        yield f"pyproject.toml: [project.urls] has no URL for {', '.join(names)}"
    control = (root / "packaging/debian/control").read_text("utf-8")
    if found := re.search(r"^Maintainer: .*<(.*\.invalid)>$", control, re.MULTILINE):
        yield f"packaging/debian/control: {found[1]} is not a real email address"
    changelog = (root / "CHANGELOG.md").read_text("utf-8")
    heading = rf"^## \[{re.escape(version)}\] - \d{{4}}-\d\d-\d\d$"
    if not re.search(heading, changelog, re.MULTILINE):
        yield f"CHANGELOG.md: the heading of {version} has no date; write '- YYYY-MM-DD' after it"
    if _NOT_IN_INDEX in (root / _INSTALL).read_text("utf-8"):
        yield f"{_INSTALL}: still states that URC is {_NOT_IN_INDEX}"
