"""The pages of the dashboard. Each Jinja template has one dataclass as its context.

Layer 5. Templates receive only the dataclass, as ``page``. The only logic in templates is ``for``
and ``if``. All other logic is in this module, and `urc.web.show.cells` builds a page's cells.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import cast
from urllib.parse import quote

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from urc import __version__
from urc.model.interface import Interface, WidgetUse
from urc.model.profile import Profile
from urc.model.widget import Footprint
from urc.runtime.one_shot_commands import can_move
from urc.shipped import shipped
from urc.web import words
from urc.web.fleet.robots import Robot
from urc.web.load.widget_trust import WidgetTrust
from urc.web.show.cells import Cell, render_foreign, widget_cell, widget_context
from urc.web.show.interfaces import (
    DEBUG_STYLES,
    DEBUGGING,
    DebugPart,
    InterfaceChoice,
    PageTab,
    choices,
    debug_part,
    is_turned,
    page_tabs,
)
from urc.web.show.layout import drawer_slots, grid_css
from urc.web.show.outputs import motion_lines, opens_on_demand
from urc.web.show.shown_visitor import shown_visitor
from urc.web.show.visitor_links import sees_audit
from urc.web.show.warnings import current_warnings

__all__ = [
    "ErrorPage",
    "PageHead",
    "RobotPage",
    "RobotPageRequest",
    "ServerParts",
    "error_page",
    "first_names",
    "render",
    "robot_page",
]

_MOST_HANDLE_CHARS = 22
"""Maximum length of several names on the drawer's handle, which is between widgets."""


@dataclass(frozen=True, slots=True)
class PageHead:
    """Data for the head element of a page."""

    nonce: str
    """Nonce of the response, required in every script and style element."""
    title: str
    import_map: Mapping[str, object] = field(default_factory=lambda: with_words({"imports": {}}))
    widget_styles: tuple[str, ...] = ()
    """URLs of widget style sheets."""
    grid_css: str = ""
    """CSS rules for the positions of cells; titles in the rules are escaped."""
    version: str = __version__


@dataclass(frozen=True, slots=True)
class Drawer:
    """The widgets in the drawer of phones in landscape."""

    cells: frozenset[int]
    """Indexes of their cells; empty if there is no drawer."""
    title: str
    """Title from the interface, title of the only widget, or a common title."""
    names: str
    """Text of the handle: the title from the interface, or else the titles of the first widgets."""


@dataclass(frozen=True, slots=True)
class RobotPage:
    """Context for ``robot.html.j2``: a robot's live interface."""

    head: PageHead
    title: str
    url: str
    """Path of the page, to which the browser returns after a sign-in."""
    socket: str
    """Path and query of the page's WebSocket."""
    interfaces: tuple[InterfaceChoice, ...]
    """All interfaces of the robot."""
    tabs: tuple[PageTab, ...]
    """Pages of the interface; empty for an interface with only one page."""
    number: int
    """Number of the open page, counted from 0."""
    is_turned: bool
    """Whether phones show the designed layout only in landscape."""
    is_part: bool
    """Whether the script ``interfaces.js`` sent the request. The script uses only the grid and the
    grid's style."""
    debug: DebugPart | None
    """Content of the debug interface, which replaces the grid; None for other interfaces."""
    cells: tuple[Cell, ...]
    drawer: Drawer
    stop_url: str
    """URL for STOP requests without a working socket."""
    alarms_url: str
    """Path of the robot's alarms in the API."""
    may_act: bool
    """Whether the page may acknowledge and shelve alarms."""
    lines: str
    """Transports of commands that stop motion, as a JSON list."""
    can_move: bool
    """Whether the page shows controls and STOP."""
    playback: str
    """API path of the playback; "" if there is no playback."""
    is_emulated: bool
    """Whether the robot is emulated."""
    settings_url: str
    """URL of the robot's settings; "" if the settings are fixed."""
    hints: str
    """The driver's hints for lost connections, keyed by transport, as a JSON object."""
    on_demand: str
    """Transports that only commands open, as a JSON list. The robot does not count as lost while
    these transports are closed."""


@dataclass(frozen=True, slots=True)
class ErrorPage:
    """Context for ``error.html.j2``: a one-sentence message and a link back."""

    head: PageHead
    status: int
    message: str


@dataclass(frozen=True, slots=True)
class ServerParts:
    """Data and rules that all robot pages of a server share."""

    modules: Mapping[str, object]
    """The import map."""
    trust: WidgetTrust = field(default_factory=WidgetTrust)
    """Rule that identifies third-party widgets."""
    has_settings: bool = False
    """Whether the server has settings pages."""


@dataclass(frozen=True, slots=True)
class RobotPageRequest:
    """A visitor's request for a robot's page."""

    nonce: str
    """Nonce of the response."""
    tab: str = ""
    """Name of the open page; "" or an unknown name selects the first page."""
    is_watching: bool = False
    """Whether the page may only watch."""
    is_part: bool = False
    """Whether an open page requests this page in order to show another interface."""
    may_act: bool = True
    """Whether the visitor has the role ``drive`` for the robot."""
    dev_url: str = ""
    """Path of the developer page; "" if the visitor may not open it."""


def robot_page(
    name: str,
    robot: Robot,
    interface: Interface,
    server: ServerParts,
    request: RobotPageRequest,
) -> str:
    """Return the page for one of a robot's interfaces.

    Another process renders third-party widgets; the call blocks until that process has ended.

    Args:
        name: the robot's name in URLs.
        robot: the robot or playback.
        interface: the interface to show.
        server: data and rules that all pages share.
        request: the visitor's request.
    """
    profile, is_recorded = robot.profile, robot.playback is not None
    is_watching = request.is_watching or is_recorded
    uses = _uses(profile, interface)
    slots = tuple(uses)
    place = quote(name, safe="")
    url, api = f"/robots/{place}/", f"/api/v1/robots/{place}"
    watch = "&watch" if is_watching else ""
    tabs = page_tabs(interface, request.tab)
    transports = profile.driver.transports
    titles = _titles(profile, uses)
    footprints = _footprints(profile, uses)
    page = RobotPage(
        head=PageHead(
            nonce=request.nonce,
            title=profile.title,
            import_map=with_words(server.modules),
            widget_styles=_styles(profile, interface, uses, server.trust),
            grid_css=grid_css(interface, slots, footprints),
        ),
        title=profile.title,
        url=url,
        socket=f"/ws?robot={place}{watch}",
        interfaces=choices(profile, interface, url, watch),
        tabs=tabs,
        number=next((each.number for each in tabs if each.is_current), 0),
        is_turned=is_turned(interface, slots),
        is_part=request.is_part,
        debug=debug_part(profile, request.dev_url) if interface is DEBUGGING else None,
        cells=_cells(profile, interface, uses, server.trust),
        drawer=_drawer(slots, drawer_slots(interface, slots, footprints), titles, interface.drawer),
        stop_url=f"{api}/stop",
        alarms_url=f"{api}/alarms",
        may_act=request.may_act and not is_watching,
        lines=json.dumps(motion_lines(profile.driver)),
        can_move=can_move(profile.driver) and not is_recorded,
        playback=f"{api}/recording" if is_recorded else "",
        is_emulated=robot.is_emulated,
        settings_url=f"{url}settings" if server.has_settings and not is_recorded else "",
        hints=json.dumps({name: one.hint for name, one in transports.items() if one.hint}),
        on_demand=json.dumps([one for one in transports if opens_on_demand(one, profile.driver)]),
    )
    return render("robot.html.j2", page)


def with_words(modules: Mapping[str, object]) -> Mapping[str, object]:
    """Return the import map, including the catalogue of the user's language."""
    imports = cast("Mapping[str, str]", modules["imports"])
    return {"imports": {**imports, "urc/words": words.address(words.language.get())}}


def error_page(nonce: str, status: int, message: str) -> str:
    """Return an error page with a one-sentence message."""
    return render("error.html.j2", ErrorPage(PageHead(nonce, f"{status}"), status, message))


def render(template: str, page: object) -> str:
    """Return the HTML of a page; `page` is the template's context."""
    return _pages().get_template(template).render(page=page)


def _uses(profile: Profile, interface: Interface) -> dict[str, WidgetUse]:
    """Return the widgets of the filled slots, in reading order."""
    found = {
        name: interface.widgets.get(name) or profile.slots.get(name) for name in interface.shown
    }
    return {name: use for name, use in found.items() if use is not None}


def _drawer(
    slots: tuple[str, ...], drawer: frozenset[str], titles: Mapping[str, str], declared: str
) -> Drawer:
    """Return the drawer with these slots; `declared` is the interface's title for it, or ""."""
    inside = [titles[name] for name in slots if name in drawer]
    title = declared or (inside[0] if len(inside) == 1 else words.t("More controls"))
    return Drawer(frozenset(map(slots.index, drawer)), title, declared or first_names(inside))


def first_names(names: Sequence[str]) -> str:
    """Return the first names of a list, with an ellipsis for the others; "" for an empty list."""
    fitting = list(names[:1])
    for name in names[1:]:
        if len(", ".join([*fitting, name])) > _MOST_HANDLE_CHARS:
            break
        fitting.append(name)
    more = " …" if len(fitting) < len(names) else ""
    return ", ".join(fitting) + more


def _footprints(profile: Profile, uses: Mapping[str, WidgetUse]) -> dict[str, Footprint]:
    return {slot: profile.widgets[use.widget].footprint for slot, use in uses.items()}


def _titles(profile: Profile, uses: Mapping[str, WidgetUse]) -> dict[str, str]:
    return {
        slot: widget_context(use, profile.widgets[use.widget], profile, uid="").title
        for slot, use in uses.items()
    }


def _cells(
    profile: Profile, interface: Interface, uses: Mapping[str, WidgetUse], trust: WidgetTrust
) -> tuple[Cell, ...]:
    render_foreign(((use, profile) for use in uses.values()), trust)
    return tuple(
        widget_cell(index, use, profile, trust, is_background=slot == interface.background)
        for index, (slot, use) in enumerate(uses.items())
    )


def _styles(
    profile: Profile, interface: Interface, uses: Mapping[str, WidgetUse], trust: WidgetTrust
) -> tuple[str, ...]:
    if interface is DEBUGGING:
        return DEBUG_STYLES
    used = dict.fromkeys(use.widget for use in uses.values())
    return trust.styles(profile.widgets[name] for name in used)


@lru_cache(maxsize=1)
def _pages() -> Environment:
    pages = Environment(
        loader=FileSystemLoader(shipped("templates")),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    pages.globals.update(t=words.t, language=words.language.get, languages=words.LANGUAGES)
    pages.globals["warnings"] = current_warnings.get
    pages.globals["sees_audit"] = sees_audit.get
    pages.globals["visitor"] = shown_visitor.get
    return pages
