"""Generated types for a set of JSON paths and a function that extracts the fields.

Private to `urc.protocol.forms.json_paths`.
"""

from collections.abc import Callable, Iterator, Mapping
from itertools import count
from typing import Any, NamedTuple

import msgspec

from urc.model.text import JsonPath
from urc.protocol.compile.source import function_of

__all__ = ["ExtractionPlan", "PathNode", "build_pick", "plan_of"]

_LISTS_TO = 64
"""Maximum array index for typed decoding; a path with a higher index decodes the whole document."""


class _Shape:
    """The required type of the value at one path in the document."""

    def __init__(self) -> None:
        self.names: dict[str, _Shape] = {}
        self.element: _Shape | None = None
        """Type of an array's elements; None if the value is not an array."""
        self.is_leaf = False

    def below(self, step: str | int) -> "_Shape":
        """Return the required type at the next path step; create it if it is missing."""
        if isinstance(step, str):
            return self.names.setdefault(step, _Shape())
        if self.element is None:
            self.element = _Shape()
        return self.element

    def is_plain(self) -> bool:
        """Return whether the value at each path has exactly one required type."""
        kinds = self.is_leaf + bool(self.names) + (self.element is not None)
        inner = [*self.names.values(), *([self.element] if self.element else [])]
        return (
            kinds == 1
            and all(name.isprintable() for name in self.names)
            and all(one.is_plain() for one in inner)
        )


class PathNode:
    """A node in the tree of paths, with the fields at its path and the nodes of longer paths."""

    def __init__(self, shape: _Shape) -> None:
        self.shape = shape
        """Required type of the value at this path."""
        self.fields: list[str] = []
        self.steps: dict[str | int, PathNode] = {}


class ExtractionPlan(NamedTuple):
    """A plan for extracting the fields at given paths from a document."""

    decode: Callable[[bytes], Any]
    """Function that decodes a document, or raises `msgspec.DecodeError` if the structure
    differs."""
    want: PathNode

    def access(self, want: PathNode, step: str | int) -> str:
        """Return the source text that accesses `step` of a value."""
        if isinstance(step, int):
            return f"[{step}]"
        return f".f{list(want.shape.names).index(step)}"

    def picking(self, variable: str, begin: Callable[[str], str]) -> Iterator[str]:
        """Yield source lines that extract all available fields from `variable`.

        Args:
            variable: name of the variable with the decoded value.
            begin: function that returns the text before the value in a field's source line, or ""
                to skip the field.
        """
        yield from self._picking(self.want, variable, "    ", begin)

    def _picking(
        self, want: PathNode, variable: str, indent: str, begin: Callable[[str], str]
    ) -> Iterator[str]:
        for field in want.fields:
            if begin(field):
                yield f"{indent}{begin(field)}{variable}"
        for place, (step, inner) in enumerate(want.steps.items()):
            name = f"{variable}_{place}"
            if isinstance(step, str):
                yield f"{indent}{name} = {variable}{self.access(want, step)}"
                is_there = f"{name} is not UNSET"
                more = f" and {name} is not None" if inner.steps else ""
                yield f"{indent}if {is_there}{more}:"
                yield f"{indent}    pass"
                yield from self._picking(inner, name, indent + "    ", begin)
            else:
                yield f"{indent}if len({variable}) > {step}:"
                yield f"{indent}    {name} = {variable}[{step}]"
                more = f"if {name} is not None:" if inner.steps else "if True:"
                yield f"{indent}    {more}"
                yield f"{indent}        pass"
                yield from self._picking(inner, name, indent + "        ", begin)


def plan_of(paths: Mapping[str, JsonPath]) -> ExtractionPlan | None:
    """Return the plan for these paths; None if no type can express them."""
    shape = _Shape()
    want = PathNode(shape)
    for name, path in paths.items():
        at, wanted = shape, want
        for step in path:
            if isinstance(step, int) and step > _LISTS_TO:
                return None
            at = at.below(step)
            wanted = wanted.steps.setdefault(step, PathNode(at))
        at.is_leaf = True
        wanted.fields.append(name)
    if not shape.names or not shape.is_plain():
        return None
    return ExtractionPlan(msgspec.json.Decoder(_type_of(shape, count())).decode, want)


def build_pick(plan: ExtractionPlan) -> Callable[[bytes], dict[str, object] | None]:
    """Return a function that extracts the fields found in a document.

    The returned function raises `msgspec.DecodeError` for a document with a different structure.
    """
    lines = ["    v = decode(data)", "    found = {}"]
    lines += plan.picking("v", "found[{!r}] = ".format)
    lines.append("    return found or None")
    scope = {"decode": plan.decode, "UNSET": msgspec.UNSET, "len": len}
    return function_of("pick", "data", lines, scope)


def _type_of(shape: _Shape, numbers: Iterator[int]) -> Any:
    if shape.is_leaf:
        return Any
    if shape.element is not None:
        element = _type_of(shape.element, numbers)
        return list[element if shape.element.is_leaf else element | None]  # type: ignore[misc]
    fields: list[tuple[str, Any, Any]] = []
    for place, inner in enumerate(shape.names.values()):
        kind = _type_of(inner, numbers)
        kind = kind if inner.is_leaf else kind | None | msgspec.UnsetType
        fields.append((f"f{place}", kind, msgspec.UNSET))
    names = {f"f{place}": name for place, name in enumerate(shape.names)}
    return msgspec.defstruct(f"Part{next(numbers)}", fields, rename=names, gc=False)
