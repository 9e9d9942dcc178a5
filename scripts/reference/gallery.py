"""The gallery pages: every shipped robot and every shipped widget, with its picture."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import yaml

__all__ = ["robots", "widgets"]

ROOT = Path(__file__).resolve().parents[2]


class _Card(NamedTuple):
    title: str
    text: str
    picture: str
    page: str


def robots() -> str:
    """Return the gallery page with a card for each shipped robot."""
    found = []
    for file in sorted((ROOT / "robots").glob("*.yaml")):
        data = yaml.safe_load(file.read_text("utf-8"))
        name = file.stem
        found.append(_Card(data["title"], data["summary"], f"robots/{name}.png", f"robots/{name}"))
    text = (
        "`urc demo` emulates every robot. The page of a robot lists its connections and commands."
    )
    return _page("Robots", text, found)


def widgets() -> str:
    """Return the gallery page with a card for each shipped widget."""
    found = []
    for file in sorted((ROOT / "widgets").glob("*/widget.yaml")):
        data = yaml.safe_load(file.read_text("utf-8"))
        name = file.parent.name
        found.append(_Card(f"`{name}`", data["summary"], f"widgets/{name}.png", f"widgets/{name}"))
    text = (
        "Every shipped widget, in the first states of its demo. Each widget's page lists its"
        " inputs, outputs and options."
    )
    return _page("Widgets", text, found)


def _page(title: str, text: str, cards: Iterable[_Card]) -> str:
    every = list(cards)
    lines = [f"# {title}", "", text, "", "::::{grid} 1 2 2 3", ":gutter: 3", ""]
    for one in every:
        lines += _card(one)
    lines += ["::::", "", "```{toctree}", ":hidden:", ""]
    lines += [f"../{one.page}" for one in every]
    return "\n".join([*lines, "```", ""])


def _card(card: _Card) -> Iterator[str]:
    yield f":::{{grid-item-card}} {card.title}"
    yield f":img-top: ../images/{card.picture}"
    yield f":link: ../{card.page}"
    yield ":link-type: doc"
    yield from ("", card.text, ":::", "")
