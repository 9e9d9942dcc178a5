"""Checks that expressions compare a signal that has named states only with those names."""

import ast
from collections.abc import Iterable, Mapping

from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import did_you_mean
from urc.expressions import Template
from urc.model.values import Signal

__all__ = ["check_words"]


def check_words(
    problems: Problems, part: Node, template: Template, signals: Mapping[str, Signal]
) -> None:
    """Warn about each comparison of a signal with text that is not one of its states."""
    worded = {
        name: dict(signals[name].states)
        for name in template.names
        if name in signals and signals[name].states and signals[name].type != "boolean"
    }
    if not worded:
        return
    for name, text in _compared(template.python):
        states = worded.get(name)
        if states is None or text in states.values():
            continue
        hint = f"write {states[text]!r}" if text in states else ""
        found = template.source.find(text)
        problems.warn(
            part,
            "unknown-word",
            f"{name!r} is never {text!r}: this text is not one of its states",
            offset=max(0, found),
            length=len(text) if found >= 0 else len(template.source),
            hint=hint or did_you_mean(text, states.values(), "words"),
        )


def _compared(python: str) -> Iterable[tuple[str, str]]:
    """Yield each name and the text that an expression compares with the name."""
    for node in ast.walk(ast.parse(python, mode="eval")):
        if not isinstance(node, ast.Compare):
            continue
        sides = [node.left, *node.comparators]
        names = [name for side in sides if (name := _name(side))]
        if len(names) != 1:
            continue
        for side in sides:
            items = side.elts if isinstance(side, ast.List) else [side]
            for item in items:
                if isinstance(item, ast.Constant) and isinstance(item.value, str) and item.value:
                    yield names[0], item.value


def _name(node: ast.expr) -> str:
    """Return the name of the value that `node` reads; "" for other nodes."""
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
        return str(node.slice.value) if isinstance(node.value, ast.Name) else ""
    return ""
