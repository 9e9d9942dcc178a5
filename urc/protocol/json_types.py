"""Types made for a set of paths, and the function that picks the fields out of them.

Floor 3, private to `urc.protocol.json_paths`.
"""

from collections.abc import Callable, Iterator, Mapping
from itertools import count
from typing import Any

import msgspec

from urc.model.text import JsonPath
from urc.protocol.generate import function_of

__all__ = ["build_pick"]

_LISTS_TO = 64
"""Places of a list up to which it is decoded by type; longer ones are mostly not wanted."""


class _Shape:
    """What a place of the document must be for the paths that go through it."""

    def __init__(self) -> None:
        self.names: dict[str, _Shape] = {}
        self.element: _Shape | None = None
        """Of a list: all its elements together."""
        self.is_leaf = False

    def below(self, step: str | int) -> "_Shape":
        """Return the shape of the next place, made when there is none."""
        if isinstance(step, str):
            return self.names.setdefault(step, _Shape())
        if self.element is None:
            self.element = _Shape()
        return self.element

    def is_plain(self) -> bool:
        """Return whether it is one kind of thing, all the way down."""
        kinds = self.is_leaf + bool(self.names) + (self.element is not None)
        inner = [*self.names.values(), *([self.element] if self.element else [])]
        return (
            kinds == 1
            and all(name.isprintable() for name in self.names)
            and all(one.is_plain() for one in inner)
        )


class _Want:
    """Which fields are at a place, and which steps lead on from it."""

    def __init__(self) -> None:
        self.fields: list[str] = []
        self.steps: dict[str | int, _Want] = {}


def build_pick(paths: Mapping[str, JsonPath]) -> Callable[[bytes], dict[str, object] | None] | None:
    """Return bytes → fields found, or None where types cannot say what the paths want.

    The function raises `msgspec.DecodeError` for a document of another structure.
    """
    shape, want = _Shape(), _Want()
    for name, path in paths.items():
        at, wanted = shape, want
        for step in path:
            if isinstance(step, int) and step > _LISTS_TO:
                return None
            at = at.below(step)
            wanted = wanted.steps.setdefault(step, _Want())
        at.is_leaf = True
        wanted.fields.append(name)
    if not shape.names or not shape.is_plain():
        return None
    decoder = msgspec.json.Decoder(_type_of(shape, count()))
    lines = ["    v = decode(data)", "    found = {}"]
    lines += _picking(want, shape, "v", "    ")
    lines.append("    return found or None")
    scope = {"decode": decoder.decode, "UNSET": msgspec.UNSET, "len": len}
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


def _picking(want: _Want, shape: _Shape, variable: str, indent: str) -> Iterator[str]:
    for field in want.fields:
        yield f"{indent}found[{field!r}] = {variable}"
    for place, (step, inner) in enumerate(want.steps.items()):
        name = f"{variable}_{place}"
        below = shape.below(step)
        if isinstance(step, str):
            attribute = f"f{list(shape.names).index(step)}"
            yield f"{indent}{name} = {variable}.{attribute}"
            is_there = f"{name} is not UNSET"
            yield (
                f"{indent}if {is_there} and {name} is not None:"
                if inner.steps
                else (f"{indent}if {is_there}:")
            )
            yield from _picking(inner, below, name, indent + "    ")
        else:
            yield f"{indent}if len({variable}) > {step}:"
            yield f"{indent}    {name} = {variable}[{step}]"
            if inner.steps:
                yield f"{indent}    if {name} is not None:"
                yield from _picking(inner, below, name, indent + "        ")
            else:
                yield from _picking(inner, below, name, indent + "    ")
