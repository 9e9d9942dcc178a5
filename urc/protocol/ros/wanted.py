"""The parts of a message that a driver reads.

Pure. A message reader skips the parts that are not wanted. `ALL` selects a whole value. A
dictionary selects fields of a message or, under the key `EACH`, parts of each array element.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final, TypeAlias, cast

from urc.model.payload import ReadSpec

__all__ = ["ALL", "EACH", "Path", "Wanted", "paths_of", "wanted_of"]

ALL: Final = True
EACH: Final = "*"
"""Path step for the elements of an array."""

Wanted: TypeAlias = "bool | dict[str, Wanted]"
Path = tuple[str, ...]

_AROUND: Final = frozenset(
    (
        "multi_select_list",
        "multi_select_dict",
        "key_val_pair",
        "function_expression",
        "or_expression",
        "and_expression",
        "not_expression",
        "comparator",
    )
)
"""Kinds of JMESPath nodes whose children are all evaluated on the same value."""


def wanted_of(paths: Iterable[Path]) -> Wanted:
    """Return the wanted parts for a set of paths; an empty path means the whole message."""
    root: dict[str, Wanted] = {}
    for path in paths:
        if not path:
            return ALL
        at = root
        for place, step in enumerate(path):
            is_last = place == len(path) - 1
            inner = at.get(step)
            if inner is True:
                break
            if is_last:
                at[step] = ALL
            else:
                if inner is None:
                    inner = at[step] = {}
                at = cast("dict[str, Wanted]", inner)
    return root


def paths_of(read: ReadSpec) -> Iterator[Path]:
    """Yield the paths that a declaration reads; the empty path means the whole message."""
    paths = read.options.get("paths")
    if read.form != "json" or not isinstance(paths, Mapping):
        yield ()
        return
    for path in paths.values():
        if isinstance(path, tuple):
            yield tuple(step if isinstance(step, str) else EACH for step in path)
        else:
            yield from _of_expression(getattr(path, "parsed", None))


def _of_expression(node: Any) -> set[Path]:
    """Return the paths that a node of a JMESPath expression reads, relative to the node's value."""
    if not isinstance(node, Mapping):
        return {()}
    kind, children = node.get("type"), node.get("children", [])
    if kind == "field":
        return {(str(node.get("value")),)}
    if kind == "literal":
        return set()
    if kind in _AROUND:
        return set[Path]().union(*map(_of_expression, children))
    if kind == "subexpression":
        found: set[Path] = {()}
        for child in children:
            if any(EACH in path for path in found) or len(found) != 1:
                return found
            head = next(iter(found))
            found = {head + path for path in _of_expression(child)}
        return found
    if kind in ("index_expression", "projection", "filter_projection", "pipe") and children:
        return _of_expression(children[0])
    return {()}
