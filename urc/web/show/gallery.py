"""The gallery: every widget in all its demo states, without a robot.

Layer 5. The script ``gallery.js`` simulates the robot in the page, so the page opens no socket and
sends nothing.
"""

import asyncio
import hashlib
import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response

from urc.config.parse.widget import WidgetFolder
from urc.model.profile import Profile
from urc.model.widget import Widget
from urc.problems import Problem, ProblemsError
from urc.runtime.file_watch import FileWatcher
from urc.runtime.widget_registry import widget_folder_of
from urc.shipped import shipped
from urc.web.load.assets import Assets, widget_assets
from urc.web.load.widget_trust import WidgetTrust
from urc.web.serve.rights import SIGNED_IN, ProtectedRoute
from urc.web.show.cells import Cell, render_foreign, widget_cell
from urc.web.show.demos import WidgetState, demo_states
from urc.web.show.menu import Nav, NavigationLinks
from urc.web.show.pages import PageHead, render, with_words
from urc.web.words import t

__all__ = ["DemoPage", "Gallery", "GalleryPage"]


class Found(NamedTuple):
    """An existing widget."""

    folder: Path
    widget: Widget | None
    """The widget described by the manifest; None for an invalid manifest."""
    problems: tuple[Problem, ...] = ()
    """Problems in the manifest."""


class WidgetLookup:
    """The existing widgets.

    Args:
        profiles: function that returns the profiles of the served robots.
        is_fresh: whether each look-up reads the manifest again; otherwise, look-ups return the
            robots' loaded widgets.
    """

    def __init__(self, profiles: Callable[[], Iterable[Profile]], *, is_fresh: bool) -> None:
        self._profiles = profiles
        self._is_fresh = is_fresh

    def names(self) -> list[str]:
        """Return the names of all widgets, including invalid widgets."""
        profiles = list(self._profiles())
        names = {name for registry in self._registries(profiles) for name in registry.names()}
        return sorted(names.union(*(profile.widgets for profile in profiles)))

    def find(self, name: str) -> Found | None:
        """Return a widget; None for an unknown name."""
        profiles = list(self._profiles())
        mine = next((one.widgets[name] for one in profiles if name in one.widgets), None)
        if mine is not None:
            registry = WidgetFolder(mine.folder.parent)
            is_read = self._is_fresh and registry.has(name)
            return _on(registry, name) if is_read else Found(mine.folder, mine)
        registries = self._registries(profiles)
        return next((_on(registry, name) for registry in registries if registry.has(name)), None)

    def folder(self, name: str) -> Path | None:
        """Return the folder of a widget without reading its manifest; None for an unknown name."""
        profiles = list(self._profiles())
        mine = [one.widgets[name].folder for one in profiles if name in one.widgets]
        registries = self._registries(profiles)
        in_folder = (registry.place(name) for registry in registries if registry.has(name))
        return next(iter(mine), None) or next(in_folder, None)

    def _registries(self, profiles: Iterable[Profile]) -> list[WidgetFolder]:
        """Return the widget folders; URC's folder is first and takes precedence."""
        files = dict.fromkeys(one.file for one in profiles)
        return [WidgetFolder(shipped("widgets")), *(widget_folder_of(file) for file in files)]


def _on(registry: WidgetFolder, name: str) -> Found:
    widget = registry.get(name)
    return Found(registry.place(name), widget, tuple(registry.problems))


def mark(text: str) -> str:
    """Return `text`.

    The function only marks the text for translation; pages translate the text with `t`.
    """
    return text


EXAMPLES = (mark("normal"), mark("stale"), mark("gone"), mark("none"), mark("hostile"))
"""Names of common states; a demo may add other states."""
SEPARATOR = "+"
MOST_AT_ONCE = 16
"""Maximum number of widgets on one page."""
NO_WIDGET = mark("There is no widget with that name.")

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class GalleryEntry:
    """One widget in the gallery's list."""

    name: str
    title: str
    summary: str
    url: str
    fault: str
    """Reason why the widget cannot be shown; "" if it can."""


@dataclass(frozen=True, slots=True)
class GalleryPage:
    """Context for ``widgets.html.j2``: the list of all widgets."""

    head: PageHead
    nav: Nav
    entries: tuple[GalleryEntry, ...]


@dataclass(frozen=True, slots=True)
class DemoView:
    """One state of one widget, as shown in the gallery."""

    widget: str
    state: str
    label: str
    """Name of the state; common state names are translated."""
    title: str
    cell: Cell
    news: str


class WidgetView(NamedTuple):
    """One widget on a gallery page."""

    name: str
    widget: Widget | None
    states: list[WidgetState]
    problems: tuple[Problem, ...] = ()
    """Problems in the widget that prevent its states from being shown."""


@dataclass(frozen=True, slots=True)
class WidgetProblem:
    """One problem in a widget that cannot be shown."""

    line: str
    """Location and description."""
    hint: str


@dataclass(frozen=True, slots=True)
class DemoPage:
    """Context for ``widget.html.j2``: widgets in their demo states."""

    head: PageHead
    title: str
    summary: str
    exhibits: tuple[DemoView, ...]
    faults: tuple[WidgetProblem, ...]
    """Problems in widgets that cannot be shown."""
    stamp_url: str
    """URL that returns the newest `stamp`, for reloads after an edit; "" to disable reloading."""
    stamp: str
    """Value that identifies the version of the widget files, computed before reading the files."""


class Gallery:
    """Pages and files of all widgets in the gallery.

    Args:
        modules: the pages' import map.
        profiles: function that returns the profiles of the served robots.
        is_dev: whether pages reload when one of their widgets' files is saved.
        ways: navigation links of this server.
        trust: rule that identifies third-party widgets.
    """

    def __init__(
        self,
        modules: Mapping[str, object],
        profiles: Callable[[], Iterable[Profile]],
        *,
        is_dev: bool = False,
        trust: WidgetTrust = WidgetTrust(),  # noqa: B008  # frozen
        ways: NavigationLinks = NavigationLinks(),  # noqa: B008 - it cannot be changed
    ) -> None:
        self._modules = modules
        self._lookup = WidgetLookup(profiles, is_fresh=is_dev)
        self._is_dev = is_dev
        self._ways = ways
        self._trust = trust
        self.assets = Assets()
        """Files of the gallery's widgets, including widgets that no robot uses."""

    def routes(self) -> list[ProtectedRoute]:
        """Return the gallery's routes, which must precede the route for the widget files."""
        return [
            ProtectedRoute("/widgets", self.index, SIGNED_IN),
            ProtectedRoute("/widgets/", self.index, SIGNED_IN),
            ProtectedRoute("/widgets/{names}/", self.demo, SIGNED_IN),
            ProtectedRoute("/widgets/{names}", with_slash, SIGNED_IN),
            ProtectedRoute("/widgets/{names}/stamp", self.stamp, SIGNED_IN),
        ]

    async def index(self, request: Request) -> Response:
        """List the widgets."""
        entries = await asyncio.to_thread(self._entries)
        head = self._head(request, t("Widgets"))
        return _answer(
            render("widgets.html.j2", GalleryPage(head, Nav("widgets", self._ways), tuple(entries)))
        )

    async def demo(self, request: Request) -> Response:
        """Show one widget, or several widgets with names joined by plus signs."""
        names = self._names(request)
        # Taken before the files are read, so that no change is missed.
        stamp = await asyncio.to_thread(self._stamp, names) if self._is_dev else ""
        shown = [await asyncio.to_thread(self._shown, name) for name in names]
        self.assets.files |= widget_assets(one.widget for one in shown if one.widget).files
        problems = [problem for one in shown for problem in one.problems]
        for problem in problems if self._is_dev else ():
            log.warning("%s", problem.headline)
        page = await asyncio.to_thread(self._page, request, shown, problems, stamp)
        return _answer(render("widget.html.j2", page), 409 if problems else 200)

    def _page(
        self,
        request: Request,
        shown: Sequence[WidgetView],
        problems: Iterable[Problem],
        stamp: str,
    ) -> DemoPage:
        widgets = [one.widget for one in shown if one.widget]
        titles = [t(one.widget.title) if one.widget else one.name for one in shown]
        is_single = len(shown) == 1
        return DemoPage(
            head=replace(
                self._head(request, titles[0] if is_single else t("Widgets")),
                widget_styles=self._trust.styles(widgets),
            ),
            title=", ".join(titles),
            summary=widgets[0].summary if is_single and widgets else "",
            exhibits=tuple(_exhibits(shown, self._trust)),
            faults=tuple(WidgetProblem(one.headline, one.hint) for one in problems),
            stamp_url="stamp" if self._is_dev else "",
            stamp=stamp,
        )

    async def stamp(self, request: Request) -> Response:
        """Return a value that changes whenever a widget file is saved."""
        if not self._is_dev:
            raise HTTPException(404)
        stamp = await asyncio.to_thread(self._stamp, self._names(request))
        return PlainTextResponse(stamp, headers={"cache-control": "no-store"})

    def _stamp(self, names: Iterable[str]) -> str:
        folders = [self._lookup.folder(name) for name in names]
        if None in folders:
            raise HTTPException(404, t(NO_WIDGET))
        files = [
            str(path)
            for folder in filter(None, folders)
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        ]
        states = repr((files, FileWatcher(files).states()))
        return hashlib.blake2b(states.encode(), digest_size=12).hexdigest()

    def _head(self, request: Request, title: str) -> PageHead:
        return PageHead(request.state.nonce, title, import_map=with_words(self._modules))

    def _entries(self) -> list[GalleryEntry]:
        entries = []
        for name in self._lookup.names():
            found = self._lookup.find(name)
            widget = found and found.widget
            title, summary = (widget.title, widget.summary) if widget else (name, "")
            fault = "" if widget else t("its manifest cannot be read: see “urc validate”")
            entries.append(GalleryEntry(name, title, summary, f"/widgets/{quote(name)}/", fault))
        return entries

    def _names(self, request: Request) -> list[str]:
        """Return the widget names in the URL; raise status 404 for too many names."""
        wanted = list(dict.fromkeys(request.path_params["names"].split(SEPARATOR)))
        if len(wanted) > MOST_AT_ONCE:
            raise HTTPException(404, f"A page shows at most {MOST_AT_ONCE} widgets.")
        return wanted

    def _shown(self, name: str) -> WidgetView:
        """Return a widget with its states or problems; raise status 404 for an unknown widget."""
        found = self._lookup.find(name)
        if found is None:
            raise HTTPException(404, t(NO_WIDGET))
        if found.widget is None:
            return WidgetView(name, None, [], found.problems)
        try:
            return WidgetView(name, found.widget, demo_states(found.widget))
        except ProblemsError as error:
            return WidgetView(name, found.widget, [], error.problems)


def _exhibits(shown: Iterable[WidgetView], trust: WidgetTrust) -> Iterable[DemoView]:
    every = [(one.widget, state) for one in shown if one.widget for state in one.states]
    render_foreign(((state.use, state.profile) for _, state in every), trust)
    for index, (widget, state) in enumerate(every):
        cell = widget_cell(index, state.use, state.profile, trust)
        label = t(state.name) if state.name in EXAMPLES else state.name
        yield DemoView(widget.name, state.name, label, widget.title, cell, state.news)


async def with_slash(request: Request) -> Response:
    """Redirect to the same path with a trailing slash."""
    return RedirectResponse(request.url.replace(path=f"{request.url.path}/").path, 308)


def _answer(html: str, status: int = 200) -> Response:
    return HTMLResponse(html, status, headers={"cache-control": "no-store"})
