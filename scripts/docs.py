"""The command `./dev docs`: check every link and picture in the Markdown files, and build the site.

The check follows only links to files in the tree, so the command needs no network.
"""

import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from urllib.parse import unquote

from scripts import site

ROOT = Path(__file__).resolve().parents[1]
GLOSSARY = ROOT / "docs" / "glossary.md"

FENCE = re.compile(r"^(```|~~~).*?^\1", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[[^\]]*\]\(<?([^)\s>]+)>?[^)]*\)")
HEADING = re.compile(r"^#{1,6}\s+(.+?)\s*#*$", re.MULTILINE)
TERM = re.compile(r"^\| ([^|]+?) \|", re.MULTILINE)
SCHEME = re.compile(r"[a-z][a-z0-9+.-]*:", re.IGNORECASE)


def main() -> int:
    """Print each broken link, and build the site; return 1 after a broken link or a failed build.

    With ``--links``, the site is not built.
    """
    pages = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
    faults = [fault for page in pages for fault in faults_of(page)]
    for fault in faults:
        print(fault)
    print(f"{len(pages)} pages, {len(faults)} broken links")
    code = 0 if sys.argv[1:] == ["--links"] else site.main()
    return 1 if faults or code else 0


def faults_of(page: Path) -> Iterator[str]:
    """Yield a line for each broken link of `page`."""
    text = page.read_text("utf-8")
    prose = FENCE.sub(lambda match: "\n" * match[0].count("\n"), text)
    for match in LINK.finditer(prose):
        target = match[1]
        if SCHEME.match(target):
            continue
        line = prose.count("\n", 0, match.start()) + 1
        if fault := fault_of(page, unquote(target)):
            yield f"{page.relative_to(ROOT)}:{line}: {target}: {fault}"


def fault_of(page: Path, target: str) -> str:
    """Return the error in a link to a file in the tree, or "" if the link is valid."""
    path, _, anchor = target.partition("#")
    file = (page.parent / path).resolve() if path else page
    if not file.is_relative_to(ROOT):
        return "points outside the tree"
    if not file.exists():
        return "no such file"
    if anchor and file.suffix == ".md" and anchor not in anchors_of(file):
        return "no such heading"
    return ""


@cache
def anchors_of(page: Path) -> set[str]:
    """Return the anchors that code-hosting sites generate from a page's headings."""
    prose = FENCE.sub("", page.read_text("utf-8"))
    plain = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in HEADING.findall(prose))
    found = {heading.strip().replace(" ", "-") for heading in plain}
    if page == GLOSSARY:
        found |= {one for cell in TERM.findall(prose) for one in term_anchors(cell)}
    return found


def term_anchors(cell: str) -> list[str]:
    """Return the anchors for a glossary cell, which may contain several terms."""
    plain = [re.sub(r"[^\w-]+", "-", term.lower()).strip("-") for term in cell.split(",")]
    return [f"term-{term}" for term in plain]


if __name__ == "__main__":
    sys.exit(main())
