"""The checks of a widget's template, module and demo, for `urc validate` and the pages.

Layer 5. Each file is checked exactly as the dashboard loads it. The check searches the module's
text, without running JavaScript.
"""

import re
from collections.abc import Iterable, Iterator
from typing import Final

from jinja2 import TemplateSyntaxError, nodes
from jinja2.meta import find_undeclared_variables

from urc._files import read_bytes
from urc.config.spelling_suggestions import did_you_mean
from urc.model.widget import Widget
from urc.problems import Problem, ProblemsError, has_errors
from urc.runtime.widget_registry import hidden_widget
from urc.web.load.widget_trust import OURS, WidgetTrust
from urc.web.show.cells import WidgetContext, render_widget, widget_context
from urc.web.show.demos import WidgetState, demo_states
from urc.web.show.sandbox import TEMPLATE, fault_line, widget_environment

__all__ = ["FILES", "check_widget"]

MODULE: Final = "widget.js"
FILES: Final = (TEMPLATE, MODULE, "demo.yaml")
"""Names of the files that a widget has in addition to its manifest."""
MOST_BYTES: Final = 1 << 20
_EXPORT: Final = re.compile(
    r"(?:^|[;}])\s*export\s+(?:default\b|\{[^}]*\bdefault\b[^}]*\})", re.MULTILINE
)
_ANY: Final = re.compile(r"^export\b.*", re.MULTILINE)


def check_widget(widget: Widget, *, with_demo: bool = True) -> list[Problem]:
    """Return the problems in the files of a widget with a valid manifest.

    Args:
        widget: the widget, either URC's own or third-party.
        with_demo: whether to check the demo; pages do not need the demo.
    """
    problems: list[Problem] = []
    if widget.name in OURS and WidgetTrust().is_foreign(widget):
        problems.append(hidden_widget(str(widget.folder / "widget.yaml"), widget.name))
    template: _TemplateCheck | None = None
    states: list[WidgetState] = []
    try:
        template = _TemplateCheck(widget, _text(widget, TEMPLATE))
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
    """Return the text of a widget's file, or raise `ProblemsError`."""
    return read_bytes(str(widget.folder / name), MOST_BYTES).decode("utf-8", "replace")


def _rendered(
    widget: Widget, states: list[WidgetState], template: "_TemplateCheck"
) -> list[Problem]:
    """Return the first error from rendering the template in the demo states."""
    for state in states:
        context = widget_context(state.use, widget, state.profile, uid="cell-0")
        try:
            render_widget(widget, context)
        except Exception as error:  # a third-party template may raise anything
            return [template.fault(error, f", in the state {state.name!r}")]
    return []


def _module(widget: Widget, text: str) -> list[Problem]:
    """Return a problem if the module's text has no default export."""
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


class _TemplateCheck:
    """One widget's template, with its checks."""

    def __init__(self, widget: Widget, source: str) -> None:
        self._widget = widget
        self._source = source
        self._lines = source.splitlines()

    def problems(self) -> list[Problem]:
        """Return the template's syntax error or its undefined names."""
        environment = widget_environment()
        try:
            environment.from_string(self._source)
            tree = environment.parse(self._source)
        except TemplateSyntaxError as error:
            return [self._problem("bad-template", str(error.message), error.lineno)]
        asked = _asked(tree)
        known = {*WidgetContext.__slots__, *environment.globals}
        found = [*self._names(tree, asked, known)]
        tables = {
            "options": self._widget.options,
            "inputs": self._widget.inputs,
            "outputs": self._widget.outputs,
        }
        for table, declared in tables.items():
            found += self._keys(tree, asked, table, declared)
        return sorted(dict.fromkeys(found), key=lambda one: (one.line, one.column))

    def fault(self, error: Exception, where: str) -> Problem:
        """Convert an exception from rendering to a problem with the line in the template."""
        text = str(error).partition("\n")[0] or type(error).__name__
        return self._problem("bad-template", f"{text}{where}", fault_line(error))

    def _names(
        self, tree: nodes.Template, asked: set[int], known: Iterable[str]
    ) -> Iterator[Problem]:
        unknown = find_undeclared_variables(tree).difference(known)
        for node in tree.find_all(nodes.Name):
            if node.ctx == "load" and node.name in unknown and id(node) not in asked:
                text = f"templates have no variable {node.name!r}"
                yield self._unknown(text, node.lineno, node.name, known)

    def _keys(
        self, tree: nodes.Template, asked: set[int], table: str, declared: Iterable[str]
    ) -> Iterator[Problem]:
        """Yield a problem for each undeclared key of a mapping, such as ``options.label``."""
        known = frozenset(declared)
        if any(node.name == table and node.ctx != "load" for node in tree.find_all(nodes.Name)):
            return  # the template assigns the name itself
        looked_up: list[nodes.Getattr | nodes.Getitem] = [*tree.find_all(nodes.Getattr)]
        looked_up += tree.find_all(nodes.Getitem)
        for node in looked_up:
            key = _key(node)
            is_of_table = isinstance(node.node, nodes.Name) and node.node.name == table
            if not is_of_table or not key or id(node) in asked:
                continue
            if key not in known and not hasattr(dict, key):
                text = f"{key!r} is not among the {table} in the manifest"
                yield self._unknown(text, node.lineno, key, known)

    def _unknown(self, text: str, line: int, name: str, known: Iterable[str]) -> Problem:
        hint = did_you_mean(name, known, "names")
        return self._problem("unknown-name", text, line, name)._replace(hint=hint)

    def _problem(self, code: str, message: str, line: int, name: str = "") -> Problem:
        text = self._lines[line - 1] if 0 < line <= len(self._lines) else ""
        start = text.find(name) if name else -1
        end = start + len(name) + 1 if start >= 0 else 0
        column = start + 1 if start >= 0 else len(text) - len(text.lstrip()) + 1
        file = str(self._widget.folder / TEMPLATE)
        return Problem(code, message, file, line, column, end, source=text)


def _asked(tree: nodes.Template) -> set[int]:
    """Return the ids of the nodes that the template checks for existence."""
    tests = [one.node for one in tree.find_all(nodes.Test) if one.name in ("defined", "undefined")]
    filters = [one.node for one in tree.find_all(nodes.Filter) if one.name in ("default", "d")]
    return {id(node) for node in (*tests, *filters)}


def _key(node: nodes.Getattr | nodes.Getitem) -> str:
    """Return the key of a look-up in the template; "" for a computed key."""
    if isinstance(node, nodes.Getattr):
        return node.attr
    key = node.arg.value if isinstance(node.arg, nodes.Const) else ""
    return key if isinstance(key, str) else ""
