"""Generate the reference: `python -m scripts.reference` writes docs/reference/.

A test fails if a page is outdated. The same code and schemas produce the same bytes on every
machine.
"""

import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from scripts.reference import (
    codes,
    command_line,
    environment,
    filters,
    gallery,
    http_api,
    keys,
    limits,
    python_client,
    websocket,
)
from scripts.reference.families import FAMILIES

__all__ = ["PAGES"]

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES: Mapping[str, Callable[[], str]] = {
    **{f"reference/keys/{name}.md": partial(keys.page, name) for name in FAMILIES},
    "reference/keys/index.md": keys.index,
    "reference/cli.md": command_line.page,
    "reference/codes.md": codes.page,
    "reference/filters.md": filters.page,
    "reference/http-api.md": http_api.page,
    "reference/websocket.md": websocket.page,
    "reference/python-client.md": python_client.page,
    "reference/environment.md": environment.page,
    "reference/limits.md": limits.page,
    "gallery/robots.md": gallery.robots,
    "gallery/widgets.md": gallery.widgets,
}
"""Functions that return the text of the generated pages, by path below docs/."""


def main() -> int:
    """Write every page, remove pages that are no longer generated, and print the changes."""
    for name, page in PAGES.items():
        file, text = DOCS / name, page()
        if not file.is_file() or file.read_text("utf-8") != text:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
            print(f"written: docs/{name}")
    for file in sorted((DOCS / "reference" / "keys").glob("*.md")):
        if f"reference/keys/{file.name}" not in PAGES:
            file.unlink()
            print(f"removed: docs/reference/keys/{file.name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
