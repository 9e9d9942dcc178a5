"""The parts of a message that a driver reads.

Pure. A message reader skips the parts that are not wanted. `ALL` selects a whole value. A
dictionary selects fields of a message or, under the key `EACH`, parts of each array element.
"""

from collections.abc import Container, Iterable, Iterator, Mapping
from typing import Any, Final, TypeAlias, cast

from urc.model.payload import ReadSpec

__all__ = ["ALL", "EACH", "FEW", "PACKED", "Path", "Wanted", "paths_of", "wanted_of"]

ALL: Final = True
EACH: Final = "*"
"""Path step for the elements of an array."""
FEW: Final = "few"
"""Path step for the elements of an array of transforms, whose number is limited."""

PACKED: Final = "packed"
"""Last path step for an array of small numbers that is read as bytes."""

Wanted: TypeAlias = "bool | dict[str, Wanted]"
Path = tuple[str, ...]

_GRID_PARTS: Final[tuple[Path, ...]] = (
    ("header", "frame_id"),
    ("info",),
    *((name,) for name in ("x", "y", "width", "height")),
    ("data", PACKED),
)
"""Paths in an occupancy grid or in its update; a message has only some of them."""
_TREE_PARTS: Final[tuple[Path, ...]] = (
    ("transforms", FEW),
    *((name,) for name in ("parent_frame_id", "child_frame_id", "timestamp")),
    ("translation",),
    ("rotation",),
)
"""Paths in a list of transforms, and in a single foxglove.FrameTransform."""
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


def paths_of(
    read: ReadSpec, grids: Container[str] = (), trees: Container[str] = ()
) -> Iterator[Path]:
    """Yield the paths that a declaration reads; the empty path means the whole message.

    Args:
        read: the declaration.
        grids: fields that are occupancy grids; only the parts of a grid are read.
        trees: fields that are transform trees.
    """
    paths = read.options.get("paths")
    if read.form != "json" or not isinstance(paths, Mapping):
        yield ()
        return
    for field, path in paths.items():
        if isinstance(path, tuple) and field in grids:
            yield from (path + part for part in _GRID_PARTS)
        elif isinstance(path, tuple) and field in trees:
            yield from (path + part for part in _TREE_PARTS)
        elif isinstance(path, tuple):
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
