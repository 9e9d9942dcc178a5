"""The reference page for problem codes, generated from the text of `urc explain`."""

from collections.abc import Iterator

import yaml

from scripts.reference.markdown import fence
from urc.config.codes import CodePage, pages

__all__ = ["page"]


def page() -> str:
    """Return the page: one section for each code."""
    every = pages()
    lines = [
        "# Problem codes",
        "",
        f"All {len(every)} codes of `urc validate`, `urc watch` and `urc send`."
        " `urc explain CODE` prints the same text.",
        "",
    ]
    for code in every.values():
        lines += _section(code)
    return "\n".join(lines).rstrip() + "\n"


def _section(code: CodePage) -> Iterator[str]:
    yield from (f"## {code.code}", "", code.what, "", code.why, "")
    yield from ("Example:", "", *_shown(code.example), "Use instead:", "", *_shown(code.instead))


def _shown(text: str) -> list[str]:
    if "\n" not in text and not text.startswith((" ", "urc:")):
        return [text, ""]
    try:
        yaml.safe_load(text)
    except (yaml.YAMLError, ValueError):  # the example of a mistake in YAML itself
        return fence(text, "text")
    return fence(text, "yaml")
