"""Reads ``codes.md``, which explains the problem codes for `urc explain` and SARIF.

Every page has the same four parts: What, Why, Example and Use instead. An example is text or a
fenced block of YAML.
"""

from pathlib import Path
from typing import NamedTuple

__all__ = ["CodePage", "pages", "summaries"]

_FILE = Path(__file__).with_name("codes.md")
_PARTS = ("What", "Why", "Example", "Use instead")


class CodePage(NamedTuple):
    """The explanation of one problem code."""

    code: str
    what: str
    """The problem, in one sentence."""
    why: str
    """Why URC reports the problem: its effect or its cause."""
    example: str
    """A document, or an excerpt of one, that has the problem; otherwise, a description in words."""
    instead: str
    """The corrected example, or instructions in words."""

    def __str__(self) -> str:
        parts = zip(_PARTS, (self.what, self.why, self.example, self.instead), strict=True)
        return "\n\n".join((self.code, *(_shown(*part) for part in parts)))


def pages() -> dict[str, CodePage]:
    """Return all pages, keyed by code, in file order."""
    _, *texts = _FILE.read_text("utf-8").split("\n## ")
    found = [_page(text) for text in texts]
    return {page.code: page for page in found}


def summaries() -> dict[str, str]:
    """Return a one-sentence summary of each code."""
    return {page.code: page.what for page in pages().values()}


def _page(text: str) -> CodePage:
    code, _, rest = text.partition("\n")
    parts = []
    for name, after in zip(_PARTS, (*_PARTS[1:], ""), strict=True):
        _, _, rest = rest.partition(f"**{name}.**")
        parts.append(rest.partition(f"\n**{after}.**")[0] if after else rest)
    return CodePage(code.strip().strip("`"), *(part.strip("\n ") for part in map(_unfenced, parts)))


def _unfenced(text: str) -> str:
    """Return the content of a fenced block; return any other text as one line."""
    _, fence, code = text.partition("```yaml\n")
    return code.partition("```")[0] if fence else " ".join(text.split())


def _shown(name: str, text: str) -> str:
    if "\n" not in text and not text.startswith(" ") and name in ("What", "Why"):
        return f"{name}: {text}"
    return f"{name}:\n" + "\n".join(f"    {line}".rstrip() for line in text.splitlines())
