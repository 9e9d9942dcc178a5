"""The ``json`` form for sent frames: any JSON value, with templates in its strings."""

from collections.abc import Iterable, Iterator
from typing import Any

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.expressions import Template
from urc.model.payload import WriteSpec

__all__ = ["compiled_tree", "parse_write", "placed_templates", "templates", "templates_in"]


def parse_write(part: Node, problems: Problems, context: FormContext) -> WriteSpec | None:
    """Return the value at `part` with compiled templates."""
    before = len(problems.problems)
    tree = compiled_tree(part, problems)
    if len(problems.problems) > before:
        return None
    found = list(templates_in(tree))
    names = frozenset[str]().union(*(one.names for one in found))
    settings = frozenset[str]().union(*(one.settings for one in found))
    return WriteSpec("json", {"tree": tree}, names, settings)


def templates(part: Node, spec: WriteSpec) -> Iterable[tuple[Node, Template]]:
    """Return every template of the value, with its position."""
    return placed_templates(part, spec.options.get("tree"))


def compiled_tree(part: Node, problems: Problems) -> Any:
    """Return the value at `part`; compile each string that has braces as a template."""
    if isinstance(part.data, dict):
        for name, inner in part.entries().items():
            if "{{" in name:
                text = "a JSON key cannot contain a template"
                problems.error(inner, "bad-template", text, key=True)
        return {name: compiled_tree(inner, problems) for name, inner in part.entries().items()}
    if isinstance(part.data, list):
        return [compiled_tree(inner, problems) for inner in part.items()]
    if isinstance(part.data, str) and "{{" in part.data:
        return problems.template(part)
    return part.data


def templates_in(tree: Any) -> Iterator[Template]:
    """Yield every template in a tree."""
    if isinstance(tree, Template):
        yield tree
    elif isinstance(tree, (dict, list)):
        for inner in tree.values() if isinstance(tree, dict) else tree:
            yield from templates_in(inner)


def placed_templates(part: Node, tree: Any) -> Iterator[tuple[Node, Template]]:
    """Yield every template in a tree, with its position."""
    if isinstance(tree, Template):
        yield part, tree
    elif isinstance(tree, dict):
        for name, inner in tree.items():
            yield from placed_templates(part.must(name), inner)
    elif isinstance(tree, list):
        for inner_part, inner in zip(part.items(), tree, strict=True):
            yield from placed_templates(inner_part, inner)
