"""The ``xml`` form: fields of an XML document, addressed by the paths of their elements."""

import re
from typing import Any

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext
from urc.model.payload import ReadSpec
from urc.model.text import XmlPath, XmlStep

__all__ = ["parse_read", "place_of"]

_NAME = r"[A-Za-z_][\w.-]*"
_STEP = re.compile(
    rf"""({_NAME})((?:\[@{_NAME}=(?:'[^'\[\]]*'|"[^"\[\]]*")\])*)(?:\[([1-9][0-9]{{0,4}})\])?"""
)
_TEST = re.compile(rf"""\[@({_NAME})=(?:'([^']*)'|"([^"]*)")\]""")
_ATTRIBUTE = re.compile(r"@([A-Za-z_][\w.:-]*)")
_PIECE = re.compile(r"(?:\[[^\]]*\]|[^/\[])*")
"""Pattern for the text up to the next slash outside brackets."""


def parse_read(part: Node, problems: Problems, context: FormContext) -> ReadSpec | None:
    """Return the path of each field."""
    paths: dict[str, XmlPath | None] = {}
    root: XmlStep | None = None
    for name, inner in part.entries().items():
        path = paths[name] = _path(inner, problems)
        if path is not None:
            root = root or path.steps[0]
            if path.steps[0] != root:
                start, other = _spelt(path.steps[0]), _spelt(root)
                text = f"this path starts at {start!r}, but another path starts at {other!r}"
                hint = "a document has one root element: write one message for each root"
                problems.error(inner, "bad-path", text, hint=hint)
                paths[name] = None
    if None in paths.values():
        return None
    return ReadSpec("xml", {"paths": paths}, tuple(paths))


def place_of(part: Node, field: str) -> tuple[Node, dict[str, Any]]:
    """Return the position of the field."""
    return part.must(field), {"key": True}


def _path(part: Node, problems: Problems) -> XmlPath | None:
    steps: list[XmlStep] = []
    offset = 0
    while True:
        piece = _piece(part.data, offset)
        is_last = offset + len(piece) >= len(part.data)
        attribute = _ATTRIBUTE.fullmatch(piece)
        if attribute and is_last and steps:
            return XmlPath(tuple(steps), attribute[1])
        step = _STEP.fullmatch(piece)
        if step is None:
            problems.error(
                part,
                "bad-path",
                f"{piece!r} is not a valid step of a path",
                offset=offset,
                length=max(1, len(piece)),
                hint="write root/element/@attribute, root/element[2] or root/element[@name='x']",
            )
            return None
        tests = tuple((one[1], one[2] or one[3] or "") for one in _TEST.finditer(step[2]))
        steps.append(XmlStep(step[1], int(step[3] or 1), tests))
        if is_last and not part.data.endswith("/"):
            return XmlPath(tuple(steps))
        offset += len(piece) + 1


def _piece(path: str, offset: int) -> str:
    """Return the path step at `offset`, including its brackets."""
    found = _PIECE.match(path, offset)
    end = found.end() if found else offset
    # After an unclosed bracket, the remaining text is one step, which the caller reports.
    return path[offset:end] if path[end : end + 1] in ("", "/") else path[offset:]


def _spelt(step: XmlStep) -> str:
    return step.tag + "".join(f"[@{name}={value!r}]" for name, value in step.attributes)
