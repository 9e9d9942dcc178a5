"""Jinja → HTML. Each template has one documented context: the dataclass that it is rendered with.

Floor 5. Templates see the dataclass as ``page`` and nothing else; logic beyond ``for`` and ``if``
belongs here. Widget templates come from packages, so they run in a sandbox, and one that fails
costs its own cell.
"""

import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import cast
from urllib.parse import quote

from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template
from jinja2.sandbox import ImmutableSandboxedEnvironment
from markupsafe import Markup

from urc import __version__
from urc.model.driver import Driver
from urc.model.interface import Interface, WidgetUse
from urc.model.profile import Profile
from urc.model.values import Signal
from urc.model.widget import Widget
from urc.shipped import shipped
from urc.web import words
from urc.web.files import linked_options
from urc.web.foreign import Border, frame_url
from urc.web.interfaces import (
    DEBUG_STYLES,
    DEBUGGING,
    Choice,
    DebugPart,
    PageTab,
    choices,
    debug_part,
    is_turned,
    page_tabs,
)
from urc.web.layout import grid_css
from urc.web.markdown import markdown
from urc.web.outputs import inputs_config, motion_lines, output_config

__all__ = [
    "Cell",
    "ErrorPage",
    "Head",
    "RobotPage",
    "WidgetContext",
    "error_page",
    "render",
    "render_widget",
    "robot_page",
    "spoken",
    "widget_cell",
    "widget_context",
]

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Head:
    """What every page needs in its head."""

    nonce: str
    """Of this one response; every script and style element carries it."""
    title: str
    import_map: Mapping[str, object] = field(default_factory=lambda: with_words({"imports": {}}))
    widget_styles: tuple[str, ...] = ()
    """URLs of widget style sheets."""
    grid_css: str = ""
    """Rules that place the cells; made of numbers only."""
    version: str = __version__


@dataclass(frozen=True, slots=True)
class Cell:
    """One slot of the grid with its widget's markup."""

    index: int
    """Place in the page's cells; the grid's rules name it."""
    config: str
    """JSON for the host: slot, widget, inputs, outputs (see ``output.js``), options, title."""
    html: Markup
    """The widget's own rendered template; "" when it failed."""
    error: str
    """Why the widget's template failed, when it did."""
    is_background: bool
    frame: str = ""
    """URL of the frame that it lives in; "" for one that lives in the page."""


@dataclass(frozen=True, slots=True)
class RobotPage:
    """``robot.html.j2``: one interface of one robot, live."""

    head: Head
    title: str
    socket: str
    """Path and query of the WebSocket."""
    interfaces: tuple[Choice, ...]
    """All that the robot has."""
    tabs: tuple[PageTab, ...]
    """Pages of this interface; empty when it has but one."""
    number: int
    """Of the page that is open."""
    is_turned: bool
    """Whether the picture is only seen as it was drawn on a phone that lies on its side."""
    is_part: bool
    """Whether ``interfaces.js`` asks, which takes out the stage and what its style is made of."""
    debug: DebugPart | None
    """What stands in place of a grid, in the interface for finding faults."""
    cells: tuple[Cell, ...]
    stop_url: str
    """Where STOP goes when the socket is down."""
    lines: str
    """JSON list of the transports that carry motion; "[]" for a robot that does not move."""
    can_move: bool
    """Whether the controls and STOP are shown."""


@dataclass(frozen=True, slots=True)
class ErrorPage:
    """``error.html.j2``: one sentence, and the way back."""

    head: Head
    status: int
    message: str


@dataclass(frozen=True, slots=True)
class WidgetContext:
    """``widgets/*/template.html.j2``, whose fields are its variables.

    The markup is shown before the module has loaded, so it must make sense without any value.
    """

    title: str
    """What the author calls this place, else the first needed signal's, else the first command's,
    else the widget's title."""
    options: Mapping[str, object]
    """Checked against the manifest; every declared option has a key, None where nothing is set."""
    inputs: Mapping[str, Signal | tuple[Signal, ...]]
    """Input → the signal bound to it, of one that takes many all of them; inputs that are not bound
    are missing."""
    widget: str
    """The widget's name."""
    uid: str
    """Unique in the page, for ``id`` and ``aria-labelledby``."""
    outputs: Mapping[str, str] = field(default_factory=dict)
    """Output → what the command bound to it is called, for people; outputs that are not bound are
    missing, so that a widget can leave out what would do nothing."""


def robot_page(
    nonce: str,
    name: str,
    profile: Profile,
    interface: Interface,
    modules: Mapping[str, object],
    *,
    is_watching: bool = False,
    tab: str = "",
    wire: str = "",
    is_part: bool = False,
    border: Border = Border(),  # noqa: B008  # frozen
) -> str:
    """Return the page of one interface.

    Args:
        nonce: of this response.
        name: of the robot in its URL.
        profile: what it is.
        interface: one of its interfaces.
        modules: the import map.
        is_watching: the page is never to drive.
        tab: name of the page of it that is open; "" or an unknown one: the first.
        wire: path of the dev page; "" where there is none for who asks.
        is_part: a page that is open already wants the interface in place of another.
        border: which widgets live in frames.
    """
    uses = _uses(profile, interface)
    slots = tuple(uses)
    used = dict.fromkeys(use.widget for use in uses.values())
    # The sheet of a foreign widget could change the whole page.
    widgets = [name for name in used if not border.is_foreign(profile.widgets[name])]
    head = Head(
        nonce=nonce,
        title=profile.title,
        import_map=with_words(modules),
        widget_styles=DEBUG_STYLES
        if interface is DEBUGGING
        else tuple(f"/widgets/{quote(widget)}/widget.css" for widget in widgets),
        grid_css=grid_css(interface, slots),
    )
    place = quote(name, safe="")
    url, watch = f"/robots/{place}/", "&watch" if is_watching else ""
    lines = motion_lines(profile.driver)
    tabs = page_tabs(interface, tab)
    page = RobotPage(
        head=head,
        title=profile.title,
        socket=f"/ws?robot={place}{watch}",
        interfaces=choices(profile, interface, url, watch),
        tabs=tabs,
        number=next((each.number for each in tabs if each.is_current), 0),
        is_turned=is_turned(interface, slots),
        is_part=is_part,
        debug=debug_part(profile, wire) if interface is DEBUGGING else None,
        cells=tuple(
            widget_cell(index, use, profile, border, is_background=slot == interface.background)
            for index, (slot, use) in enumerate(uses.items())
        ),
        stop_url=f"/api/v1/robots/{place}/stop",
        lines=json.dumps(lines),
        can_move=bool(lines),
    )
    return render("robot.html.j2", page)


def with_words(modules: Mapping[str, object]) -> Mapping[str, object]:
    """Return the import map with the words of the reader's language in it."""
    imports = cast("Mapping[str, str]", modules["imports"])
    return {"imports": {**imports, "urc/words": words.address(words.language.get())}}


def error_page(nonce: str, status: int, message: str) -> str:
    """Return a page that says what is wrong in one sentence."""
    return render("error.html.j2", ErrorPage(Head(nonce, f"{status}"), status, message))


def render(template: str, page: object) -> str:
    """Return a page's HTML; `page` is the dataclass that the template is documented with."""
    return _pages().get_template(template).render(page=page)


def render_widget(widget: Widget, context: WidgetContext) -> Markup:
    """Return the widget's markup. Whatever its template raises comes through."""
    source = (widget.folder / "template.html.j2").read_text(encoding="utf-8")
    variables = {name: getattr(context, name) for name in WidgetContext.__slots__}
    return Markup(_widget_template(source).render(variables))  # noqa: S704  # autoescaped


def widget_context(use: WidgetUse, widget: Widget, profile: Profile, uid: str) -> WidgetContext:
    """Return what the widget's template may know."""
    signals = profile.driver.signals
    single = {name: signals[signal] for name, signal in use.inputs.items()}
    several = {name: tuple(signals[one] for one in many) for name, many in use.lists.items()}
    outputs = {name: _called(command, profile.driver) for name, command in use.outputs.items()}
    declared: dict[str, object] = dict.fromkeys(widget.options)
    first = single | {name: many[0] for name, many in several.items() if many}
    title = use.title or _heading(widget, first, outputs)
    options = {**declared, **linked_options(use, profile.name)}
    return WidgetContext(title, options, {**single, **several}, widget.name, uid, outputs)


def _heading(widget: Widget, inputs: Mapping[str, Signal], outputs: Mapping[str, str]) -> str:
    """Return what the widget is about: the first signal it needs, else its command."""
    needed = [name for name in inputs if widget.inputs[name].is_required]
    about = [inputs[name].title or spoken(inputs[name].name) for name in (*needed, *inputs)]
    if not needed:
        about = [*outputs.values(), *about]
    return next(iter(about), widget.title)


def _called(command: str, driver: Driver) -> str:
    known = driver.commands.get(command)
    return (known and known.title) or spoken(command)


def widget_cell(
    index: int,
    use: WidgetUse,
    profile: Profile,
    border: Border = Border(),  # noqa: B008  # frozen
    *,
    is_background: bool = False,
) -> Cell:
    """Return one slot with its widget; whatever the widget's template raises costs this one."""
    widget = profile.widgets[use.widget]
    context = widget_context(use, widget, profile, uid=f"cell-{index}")
    html, error = Markup(), ""
    try:
        html = render_widget(widget, context)
    except Exception as problem:  # a supervisor: a widget costs its own cell
        log.warning("widget %s: its template failed: %s", widget.name, problem)
        error = f"{type(problem).__name__}: {problem}"
    config = {
        "slot": use.slot,
        "widget": use.widget,
        "title": context.title,
        **inputs_config(use, widget, profile.driver),
        "outputs": {name: output_config(use, name, widget, profile.driver) for name in use.outputs},
        "options": dict(context.options),
    }
    frame = frame_url(widget) if border.is_foreign(widget) else ""
    return Cell(index, json.dumps(config), html, error, is_background, frame)


def _uses(profile: Profile, interface: Interface) -> dict[str, WidgetUse]:
    """Return slot → widget, in reading order; slots that nobody fills are left out."""
    found = {
        name: interface.widgets.get(name) or profile.slots.get(name) for name in interface.shown
    }
    return {name: use for name, use in found.items() if use is not None}


def spoken(name: str) -> str:
    """Return an identifier as a person would write it: ``left_motor`` → ``Left motor``."""
    words = name.replace("_", " ").replace("-", " ").strip()
    return words[:1].upper() + words[1:]


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
    return pages


@lru_cache(maxsize=1)
def _widgets() -> Environment:
    widgets = ImmutableSandboxedEnvironment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    widgets.globals["t"] = words.t
    widgets.filters["markdown"] = markdown
    return widgets


@lru_cache(maxsize=256)
def _widget_template(source: str) -> Template:
    return _widgets().from_string(source)
