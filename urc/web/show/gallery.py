"""The gallery: every widget there is, and each in the states of its demo, without any robot.

Floor 5. The page itself plays the robot (``gallery.js``); no socket is opened, nothing is sent.
"""

import asyncio
import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from urllib.parse import quote

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import Route

from urc.config.parse_widget import Shelf
from urc.model.widget import Widget
from urc.problems import UrcError
from urc.runtime.changes import Watched
from urc.shipped import shipped
from urc.web.load.assets import Assets, widget_assets
from urc.web.load.foreign import Border
from urc.web.show.cells import Cell, widget_cell
from urc.web.show.demos import DemoState, demo_states
from urc.web.show.menu import Nav, Ways
from urc.web.show.pages import Head, render, with_words
from urc.web.words import t

__all__ = ["DemoPage", "Gallery", "GalleryPage"]


def mark(text: str) -> str:
    """Return the text; pages say it by `t`, and the catalogues must have it."""
    return text


EXAMPLES = (mark("normal"), mark("stale"), mark("gone"), mark("none"), mark("hostile"))
"""Names of states that most widgets have; others are called as their authors call them."""
SEPARATOR = "+"
MOST_AT_ONCE = 16
"""Widgets on one page."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One widget in the list."""

    name: str
    title: str
    summary: str
    url: str
    fault: str
    """Why it cannot be shown; "" when it can."""


@dataclass(frozen=True, slots=True)
class GalleryPage:
    """``widgets.html.j2``: the list of widgets."""

    head: Head
    nav: Nav
    entries: tuple[Entry, ...]


@dataclass(frozen=True, slots=True)
class Exhibit:
    """One state of one widget."""

    widget: str
    state: str
    label: str
    """What the state is called, in the reader's language where most widgets have it."""
    title: str
    cell: Cell
    news: str


@dataclass(frozen=True, slots=True)
class DemoPage:
    """``widget.html.j2``: widgets in the states of their demos."""

    head: Head
    title: str
    summary: str
    exhibits: tuple[Exhibit, ...]
    stamp_url: str
    """What changes when a file of theirs is saved; "" where nobody looks for that."""


class Gallery:
    """Pages and files of all widgets there are.

    Args:
        modules: the import map.
        brought: returns the widgets that the served robots bring.
        is_dev: pages load themselves anew when a file of their widgets is saved.
        ways: which pages there are beside.
        border: which widgets live in frames.
    """

    def __init__(
        self,
        modules: Mapping[str, object],
        brought: Callable[[], Iterable[Widget]],
        *,
        is_dev: bool = False,
        border: Border = Border(),  # noqa: B008  # frozen
        ways: Ways = Ways(),  # noqa: B008 - it cannot be changed
    ) -> None:
        self._modules = modules
        self._brought = brought
        self._is_dev = is_dev
        self._ways = ways
        self._border = border
        self.assets = Assets()
        """Of the widgets that were looked at; they need not belong to any robot."""

    def routes(self) -> list[Route]:
        """Return what has to come before the route of the widgets' files."""
        return [
            Route("/widgets", self.index),
            Route("/widgets/", self.index),
            Route("/widgets/{names}/", self.demo),
            Route("/widgets/{names}/stamp", self.stamp),
        ]

    async def index(self, request: Request) -> Response:
        """List the widgets."""
        entries = await asyncio.to_thread(self._entries)
        head = self._head(request, t("Widgets"))
        return _answer(
            render("widgets.html.j2", GalleryPage(head, Nav("widgets", self._ways), tuple(entries)))
        )

    async def demo(self, request: Request) -> Response:
        """Show one widget, or several with a plus between their names."""
        widgets = await asyncio.to_thread(self._named, request.path_params["names"])
        self.assets.files |= widget_assets(widgets).files
        try:
            states = [(one, await asyncio.to_thread(demo_states, one)) for one in widgets]
        except UrcError as error:
            raise HTTPException(409, f"{error}") from error
        single = widgets[0] if len(widgets) == 1 else None
        page = DemoPage(
            head=replace(
                self._head(request, t(single.title) if single else t("Widgets")),
                widget_styles=self._border.styles(widgets),
            ),
            title=t(single.title) if single else ", ".join(t(one.title) for one in widgets),
            summary=single.summary if single else "",
            exhibits=tuple(_exhibits(states, self._border)),
            stamp_url="stamp" if self._is_dev else "",
        )
        return _answer(render("widget.html.j2", page))

    async def stamp(self, request: Request) -> Response:
        """Return a text that is another one when a file of the widgets has been saved."""
        if not self._is_dev:
            raise HTTPException(404)
        stamp = await asyncio.to_thread(self._stamp, request.path_params["names"])
        return PlainTextResponse(stamp, headers={"cache-control": "no-store"})

    def _stamp(self, names: str) -> str:
        files = [
            str(path)
            for widget in self._named(names)
            for path in sorted(widget.folder.rglob("*"))
            if path.is_file()
        ]
        states = repr((files, Watched(files).states()))
        return hashlib.blake2b(states.encode(), digest_size=12).hexdigest()

    def _head(self, request: Request, title: str) -> Head:
        return Head(request.state.nonce, title, import_map=with_words(self._modules))

    def _entries(self) -> list[Entry]:
        shelf = Shelf(shipped("widgets"))
        brought = {widget.name: widget for widget in self._brought()}
        found = {name: brought.get(name) or shelf.get(name) for name in {*shelf.names(), *brought}}
        entries = []
        for name in sorted(found):
            widget = found[name]
            title, summary = (widget.title, widget.summary) if widget else (name, "")
            fault = "" if widget else t("its manifest cannot be read: urc validate says why")
            entries.append(Entry(name, title, summary, f"/widgets/{quote(name)}/", fault))
        return entries

    def _named(self, names: str) -> list[Widget]:
        """Return the widgets; raise 404 for one that there is not."""
        wanted = dict.fromkeys(names.split(SEPARATOR))
        if len(wanted) > MOST_AT_ONCE:
            raise HTTPException(404, f"A page shows {MOST_AT_ONCE} widgets at most.")
        brought = {widget.name: widget for widget in self._brought()}
        shelf = Shelf(shipped("widgets"))
        found = {name: brought.get(name) or shelf.get(name) for name in wanted}
        known = [widget for widget in found.values() if widget is not None]
        if len(known) < len(found):
            raise HTTPException(404, "There is no widget of that name, or its manifest is broken.")
        return known


def _exhibits(
    states: Iterable[tuple[Widget, list[DemoState]]], border: Border
) -> Iterable[Exhibit]:
    index = 0
    for widget, shown in states:
        for state in shown:
            cell = widget_cell(index, state.use, state.profile, border)
            label = t(state.name) if state.name in EXAMPLES else state.name
            yield Exhibit(widget.name, state.name, label, widget.title, cell, state.news)
            index += 1


def _answer(html: str) -> Response:
    return HTMLResponse(html, headers={"cache-control": "no-store"})
