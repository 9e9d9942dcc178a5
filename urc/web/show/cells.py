"""One cell of a page: the widget's markup and the configuration for the widget's module.

Layer 5. Packages provide the widget templates. The templates run in a sandbox, and a failed
template affects only its own cell.
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
from urc.model.widget import Footprint, Widget
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
    """One filled slot of an interface's grid, with the markup of its widget."""

    index: int
    """Number of the cell on the page, used in the grid's CSS rules."""
    config: str
    """JSON for the widget host: slot, widget, inputs, outputs (see ``output.js``), options,
    title."""
    html: Markup
    """Rendered template of the widget; "" after a failure."""
    error: str
    """Reason for the template's failure; "" on success."""
    is_background: bool
    frame: str = ""
    """URL of the widget's frame; "" for a widget that runs in the page."""
    footprint: Footprint = "instrument"
    is_picture: bool = False
    """Whether the widget shows a camera image."""


@dataclass(frozen=True, slots=True)
class WidgetContext:
    """Context for ``widgets/*/template.html.j2``; its fields are the variables of the template.

    The page shows the markup before the widget's module has loaded, so the markup must be
    understandable without values.
    """

    title: str
    """Title of the slot. A slot without a title gets the title of the first required signal, the
    first command, the first signal or the widget, in this order."""
    options: Mapping[str, object]
    """Checked options. Every declared option has a key; None means that the option has no value."""
    inputs: Mapping[str, Signal | tuple[Signal, ...]]
    """Each input's signal, or each multiple input's list of signals, keyed by input name. Unbound
    inputs are omitted."""
    widget: str
    """The widget's name."""
    uid: str
    """Identifier that is unique on the page, for ``id`` and ``aria-labelledby``."""
    outputs: Mapping[str, str] = field(default_factory=dict)
    """Readable name of each output's command, keyed by output name. Unbound outputs are omitted, so
    that a widget can omit their controls."""
    hazardous: tuple[str, ...] = ()
    """Names of the outputs whose command must always be confirmed with a slide."""
    asking: tuple[str, ...] = ()
    """Names of the outputs whose command always asks a question, hazardous commands included."""


def render_widget(widget: Widget, context: WidgetContext) -> Markup:
    """Return the widget's markup; propagate any exception from its template."""
    source, variables = _source(widget), _variables(context)
    return Markup(widget_template(source).render(variables))  # noqa: S704  # autoescaped


def render_foreign(uses: Iterable[tuple[WidgetUse, Profile]], trust: WidgetTrust) -> None:
    """Render the markup of all third-party widgets on a page in one step, to save time.

    Args:
        uses: the widget and the robot's profile for each cell, in the order of the cells.
        trust: rule that identifies third-party widgets.
    """
    wanted = []
    for index, (use, profile) in enumerate(uses):
        widget = profile.widgets[use.widget]
        if trust.is_foreign(widget):
            try:
                context = widget_context(use, widget, profile, uid=f"cell-{index}")
                wanted.append((_source(widget), _variables(context)))
            except OSError:
                continue  # the widget's cell shows the error
    markup_of(wanted)


def _source(widget: Widget) -> str:
    return (widget.folder / TEMPLATE).read_text(encoding="utf-8")


def _variables(context: WidgetContext) -> dict[str, object]:
    return {name: getattr(context, name) for name in WidgetContext.__slots__}


def widget_context(use: WidgetUse, widget: Widget, profile: Profile, uid: str) -> WidgetContext:
    """Return the variables of a widget's template."""
    signals = profile.driver.signals
    single = {name: signals[signal] for name, signal in use.inputs.items()}
    several = {name: tuple(signals[one] for one in many) for name, many in use.lists.items()}
    outputs = {name: _called(command, profile.driver) for name, command in use.outputs.items()}
    declared: dict[str, object] = dict.fromkeys(widget.options)
    first = single | {name: many[0] for name, many in several.items() if many}
    title = use.title or _heading(widget, first, outputs)
    options = {**declared, **linked_options(use, profile.name)}
    asking = {
        name: known.confirm.level
        for name, command in use.outputs.items()
        if (known := profile.driver.commands.get(command)) and known.confirm
    }
    hazards = tuple(name for name, level in asking.items() if level == "hazardous")
    inputs: dict[str, Signal | tuple[Signal, ...]] = {**single, **several}
    return WidgetContext(title, options, inputs, widget.name, uid, outputs, hazards, tuple(asking))


def _heading(widget: Widget, inputs: Mapping[str, Signal], outputs: Mapping[str, str]) -> str:
    """Return the name of a widget's subject: its first required signal, or else its command.

    The command of an optional output is never the subject. For example, the subject of a camera
    widget with pan and tilt is the camera.
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
    """Return one slot with its widget; an exception in the template affects only this cell.

    A separate process renders the template of a third-party widget. The call waits for this
    process, unless `render_foreign` has already rendered the template.
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
    except Exception as problem:  # a supervisor: a faulty widget must affect only its own cell
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
    is_picture = any("image" in port.types for port in widget.inputs.values())
    return Cell(
        index, json.dumps(config), html, error, is_background, frame, widget.footprint, is_picture
    )


def spoken(name: str) -> str:
    """Return an identifier in readable form, for example ``Left motor`` for ``left_motor``."""
    words = name.replace("_", " ").replace("-", " ").strip()
    return words[:1].upper() + words[1:]
