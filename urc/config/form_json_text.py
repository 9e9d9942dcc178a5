"""The form ``json`` of what is sent: any value, with templates in its leaves."""

from collections.abc import Iterable, Iterator
from typing import Any

from urc.config.forms import FormContext
from urc.config.part import Findings, Part
from urc.expressions import Template
from urc.model.codec import WriteSpec

__all__ = ["parse_write", "templates"]


def parse_write(part: Part, findings: Findings, context: FormContext) -> WriteSpec | None:
    """Return the value at `part`, its templates compiled."""
    before = len(findings.problems)
    tree = _compiled(part, findings)
    if len(findings.problems) > before:
        return None
    found = list(_templates(tree))
    names = frozenset[str]().union(*(one.names for one in found))
    settings = frozenset[str]().union(*(one.settings for one in found))
    return WriteSpec("json", {"tree": tree}, names, settings)


def templates(part: Part, spec: WriteSpec) -> Iterable[tuple[Part, Template]]:
    """Return every template in it, with its place."""
    return _placed(part, spec.options.get("tree"))


def _compiled(part: Part, findings: Findings) -> Any:
    if isinstance(part.data, dict):
        for name, inner in part.entries().items():
            if "{{" in name:
                text = "templates stand in values, not in names"
                findings.error(inner, "bad-template", text, key=True)
        return {name: _compiled(inner, findings) for name, inner in part.entries().items()}
    if isinstance(part.data, list):
        return [_compiled(inner, findings) for inner in part.items()]
    if isinstance(part.data, str) and "{{" in part.data:
        return findings.template(part)
    return part.data


def _templates(tree: Any) -> Iterator[Template]:
    if isinstance(tree, Template):
        yield tree
    elif isinstance(tree, (dict, list)):
        for inner in tree.values() if isinstance(tree, dict) else tree:
            yield from _templates(inner)


def _placed(part: Part, tree: Any) -> Iterator[tuple[Part, Template]]:
    if isinstance(tree, Template):
        yield part, tree
    elif isinstance(tree, dict):
        for name, inner in tree.items():
            yield from _placed(part.must(name), inner)
    elif isinstance(tree, list):
        for inner_part, inner in zip(part.items(), tree, strict=True):
            yield from _placed(inner_part, inner)
