"""What `urc validate` says of a widget beside its manifest: its template, its module, its demo.

Floor 5. Each is read as the dashboard reads it; the module is only looked at, for nothing here runs
JavaScript.
"""

import re
from typing import Final

from urc._files import read_bytes
from urc.model.widget import Widget
from urc.problems import Problem, ProblemsError, has_errors
from urc.runtime.shelves import hidden_widget
from urc.web.load.foreign import OURS, Border
from urc.web.show.cells import render_widget, widget_context
from urc.web.show.demos import DemoState, demo_states
from urc.web.show.sandbox import TEMPLATE
from urc.web.show.template_check import TemplateCheck

__all__ = ["FILES", "check_widget"]

MODULE: Final = "widget.js"
FILES: Final = (TEMPLATE, MODULE, "demo.yaml")
"""What is read beside the manifest."""
MOST_BYTES: Final = 1 << 20
_EXPORT: Final = re.compile(
    r"(?:^|[;}])\s*export\s+(?:default\b|\{[^}]*\bdefault\b[^}]*\})", re.MULTILINE
)
_ANY: Final = re.compile(r"^export\b.*", re.MULTILINE)


def check_widget(widget: Widget, *, with_demo: bool = True) -> list[Problem]:
    """Return what is wrong with the files of a widget whose manifest is sound.

    Args:
        widget: it may have come from anywhere.
        with_demo: its author wants to know of the demo; a page that shows the widget needs none.
    """
    problems: list[Problem] = []
    if widget.name in OURS and Border().is_foreign(widget):
        problems.append(hidden_widget(str(widget.folder / "widget.yaml"), widget.name))
    template: TemplateCheck | None = None
    states: list[DemoState] = []
    try:
        template = TemplateCheck(widget, _text(widget, TEMPLATE))
        problems += template.problems()
    except ProblemsError as error:
        problems += error.problems
    try:
        states = demo_states(widget) if with_demo else []
    except ProblemsError as error:
        problems += error.problems
    if template is not None and not has_errors(problems):
        problems += _rendered(widget, states, template)
    try:
        problems += _module(widget, _text(widget, MODULE))
    except ProblemsError as error:
        problems += error.problems
    return problems


def _text(widget: Widget, name: str) -> str:
    """Return a file of a widget; raise `ProblemsError`."""
    return read_bytes(str(widget.folder / name), MOST_BYTES).decode("utf-8", "replace")


def _rendered(widget: Widget, states: list[DemoState], template: TemplateCheck) -> list[Problem]:
    """Return why the template cannot be rendered in a state; one finding is enough."""
    for state in states:
        context = widget_context(state.use, widget, state.profile, uid="cell-0")
        try:
            render_widget(widget, context)
        except Exception as error:  # whatever a template of somebody else raises
            return [template.fault(error, f", in the state {state.name!r}")]
    return []


def _module(widget: Widget, text: str) -> list[Problem]:
    """Return that the module exports nothing by default, as far as its text tells."""
    if _EXPORT.search(text):
        return []
    nearest = _ANY.search(text)
    return [
        Problem(
            "no-default-export",
            "the module has no default export",
            str(widget.folder / MODULE),
            text.count("\n", 0, nearest.start()) + 1 if nearest else 1,
            source=nearest[0] if nearest else "",
            hint="write 'export default { mount(ctx) { … } };'",
        )
    ]
