"""One cell of a page: the widget's markup, and the configuration for its module.

Layer 5. Widget templates come from packages. These templates run in a sandbox, and a failure only
affects their own cell.
"""

import json
import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from markupsafe import Markup

from urc.model.driver import Driver
from urc.model.interface import WidgetUse
from urc.model.profile import Profile
from urc.model.values import Signal
from urc.model.widget import Widget
from urc.web.load.files import linked_options
from urc.web.load.widget_trust import WidgetTrust, frame_url
from urc.web.show.isolated_markup import markup_of
from urc.web.show.outputs import inputs_config, output_config
from urc.web.show.sandbox import TEMPLATE, fault_line, widget_template

__all__ = [
    "Cell",
    "WidgetContext",
    "render_foreign",
    "render_widget",
    "spoken",
    "widget_cell",
    "widget_context",
]

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Cell:
    """One slot of the grid with its widget's markup."""

    index: int
    """Number of the cell in the page; the grid's rules use it."""
    config: str
    """JSON for the host: slot, widget, inputs, outputs (see ``output.js``), options, title."""
    html: Markup
    """The widget's own rendered template; "" when it failed."""
    error: str
    """Why the widget's template failed, or ""."""
    is_background: bool
    frame: str = ""
    """URL of the widget's frame; "" for a widget in the page."""


@dataclass(frozen=True, slots=True)
class WidgetContext:
    """``widgets/*/template.html.j2``, whose fields are its variables.

    The markup is shown before the module has loaded, so it must make sense without any value.
    """

    title: str
    """Title of the slot. Without one: the title of the first required signal, the first command,
    the first signal or the widget, in this order."""
    options: Mapping[str, object]
    """Checked options. Every declared option has a key; None means no value."""
    inputs: Mapping[str, Signal | tuple[Signal, ...]]
    """Input → its signal, or its signals for an input of many. Unbound inputs are missing."""
    widget: str
    """The widget's name."""
    uid: str
    """Unique in the page, for ``id`` and ``aria-labelledby``."""
    outputs: Mapping[str, str] = field(default_factory=dict)
    """Output → readable name of its command. Unbound outputs are missing, so that a widget can
    leave their controls out."""


def render_widget(widget: Widget, context: WidgetContext) -> Markup:
    """Return the widget's markup; pass on any exception of its template."""
    source, variables = _source(widget), _variables(context)
    return Markup(widget_template(source).render(variables))  # noqa: S704  # autoescaped


def render_foreign(uses: Iterable[tuple[WidgetUse, Profile]], trust: WidgetTrust) -> None:
    """Render the markup of all third-party widgets of a page at once, which saves time.

    Args:
        uses: the cells in their order, each with the profile of its robot.
        trust: tells third-party widgets from trusted ones.
    """
    wanted = []
    for index, (use, profile) in enumerate(uses):
        widget = profile.widgets[use.widget]
        if trust.is_foreign(widget):
            try:
                context = widget_context(use, widget, profile, uid=f"cell-{index}")
                wanted.append((_source(widget), _variables(context)))
            except OSError:
                continue  # its cell shows the error
    markup_of(wanted)


def _source(widget: Widget) -> str:
    return (widget.folder / TEMPLATE).read_text(encoding="utf-8")


def _variables(context: WidgetContext) -> dict[str, object]:
    return {name: getattr(context, name) for name in WidgetContext.__slots__}


def widget_context(use: WidgetUse, widget: Widget, profile: Profile, uid: str) -> WidgetContext:
    """Return the variables of the widget's template."""
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
    """Return the subject of the widget: its first required signal, else its command.

    An additional output is not its subject: a camera with pan and tilt is a camera.
    """
    needed = [name for name in inputs if widget.inputs[name].is_required]
    about = [inputs[name].title or spoken(inputs[name].name) for name in (*needed, *inputs)]
    ports = [port for name, port in widget.outputs.items() if name in outputs]
    aside = [port.name for port in ports if port.is_held and not port.is_required]
    if not needed:
        given = [called for name, called in outputs.items() if name not in aside]
        about = [*given, *about, *(outputs[name] for name in aside)]
    return next(iter(about), widget.title)


def _called(command: str, driver: Driver) -> str:
    known = driver.commands.get(command)
    return (known and known.title) or spoken(command)


def widget_cell(
    index: int,
    use: WidgetUse,
    profile: Profile,
    trust: WidgetTrust = WidgetTrust(),  # noqa: B008  # frozen
    *,
    is_background: bool = False,
) -> Cell:
    """Return one slot with its widget; an exception of the template only affects this cell.

    Another process renders the template of a third-party widget. The call waits for it, unless
    `render_foreign` has done so before.
    """
    widget = profile.widgets[use.widget]
    context = widget_context(use, widget, profile, uid=f"cell-{index}")
    html, error = Markup(), ""
    is_foreign = trust.is_foreign(widget)
    try:
        if is_foreign:
            html, fault, line = markup_of([(_source(widget), _variables(context))])[0]
            error = fault and f"{TEMPLATE}:{line}: {fault}"
        else:
            html = render_widget(widget, context)
    except Exception as problem:  # a supervisor: a widget may only break its own cell
        place = f"{TEMPLATE}:{fault_line(problem)}"
        error = f"{place}: {type(problem).__name__}: {problem}"
    if error:
        log.warning("widget %s: %s", widget.name, error)
    config = {
        "slot": use.slot,
        "widget": use.widget,
        "title": context.title,
        **inputs_config(use, widget, profile.driver),
        "outputs": {name: output_config(use, name, widget, profile.driver) for name in use.outputs},
        "options": dict(context.options),
        "deadMan": widget.is_dead_man,
    }
    frame = frame_url(widget) if is_foreign else ""
    return Cell(index, json.dumps(config), html, error, is_background, frame)


def spoken(name: str) -> str:
    """Return an identifier in readable form: ``left_motor`` → ``Left motor``."""
    words = name.replace("_", " ").replace("-", " ").strip()
    return words[:1].upper() + words[1:]
