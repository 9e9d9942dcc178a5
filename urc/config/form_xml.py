"""The form ``xml``: fields out of an XML document, by the elements that lead to them."""

import re
from typing import Any

from urc.config.forms import FormContext
from urc.config.part import Findings, Part
from urc.model.codec import ReadSpec
from urc.model.text import XmlPath, XmlStep

__all__ = ["parse_read", "place_of"]

_STEP = re.compile(r"([A-Za-z_][\w.-]*)(?:\[([1-9][0-9]{0,4})\])?")
_ATTRIBUTE = re.compile(r"@([A-Za-z_][\w.:-]*)")


def parse_read(part: Part, findings: Findings, context: FormContext) -> ReadSpec | None:
    """Return where each field is."""
    paths: dict[str, XmlPath | None] = {}
    root = ""
    for name, inner in part.entries().items():
        path = paths[name] = _path(inner, findings)
        if path is not None:
            root = root or path.steps[0].tag
            if path.steps[0].tag != root:
                text = f"this path starts at {path.steps[0].tag!r}, another one at {root!r}"
                findings.error(inner, "bad-path", text, hint="a document has one root element")
                paths[name] = None
    if None in paths.values():
        return None
    return ReadSpec("xml", {"paths": paths}, tuple(paths))


def place_of(part: Part, field: str) -> tuple[Part, dict[str, Any]]:
    """Return where the field is named."""
    return part.must(field), {"key": True}


def _path(part: Part, findings: Findings) -> XmlPath | None:
    steps: list[XmlStep] = []
    offset = 0
    pieces = part.data.split("/")
    for place, piece in enumerate(pieces):
        is_last = place == len(pieces) - 1
        attribute = _ATTRIBUTE.fullmatch(piece)
        if attribute and is_last and steps:
            return XmlPath(tuple(steps), attribute[1])
        step = _STEP.fullmatch(piece)
        if step is None:
            findings.error(
                part,
                "bad-path",
                f"{piece!r} is no step of a path",
                offset=offset,
                length=max(1, len(piece)),
                hint="write root/element/@attribute, or root/element[2]",
            )
            return None
        steps.append(XmlStep(step[1], int(step[2] or 1)))
        offset += len(piece) + 1
    return XmlPath(tuple(steps))
