"""Parser for the coordinate frame of a signal, and for changes to another frame."""

from collections.abc import Mapping
from typing import Final

from urc.config.node import Node, Problems
from urc.expressions import Template
from urc.model.values import FrameChange, Signal

__all__ = ["parse_frame", "parse_frame_change", "with_frame_changes"]

_NUMBERS: Final = ("integer", "number")
_POSE_SIZES: Final = (None, 3, 7)
_METRES: Final = ("", "m")


def parse_frame(part: Node, element: str, problems: Problems) -> Template | None:
    """Return the name of the coordinate frame of the signal at `part`, as a template."""
    inner = part.get("frame")
    if inner is None:
        return None
    if element not in _NUMBERS:
        text = f"'frame' has no effect for type {part.text('type', 'number')}"
        hint = "only numbers and arrays of numbers refer to a coordinate frame"
        problems.error(part, "misplaced-key", text, at="frame", key=True, hint=hint)
        return None
    return problems.template(inner)


def parse_frame_change(
    part: Node, frame: Template | None, kind: str, problems: Problems
) -> FrameChange | None:
    """Return the change of a computed signal to `frame`, still without its source and tree."""
    shape = part.get("transform")
    if shape is None:
        return None
    if "value" not in part.data:
        problems.error(
            part,
            "misplaced-key",
            "'transform' has no effect without 'value'",
            at="transform",
            key=True,
            hint='compute the signal from another signal, such as value: "[x, y, yaw]"',
        )
        return None
    if frame is None:
        problems.error(
            part,
            "missing-key",
            "'transform' needs the frame to which it changes the value",
            at="transform",
            key=True,
            hint="add the name of a coordinate frame, such as frame: map",
        )
        return None
    fits = kind == "array" and part.text("items", "number") == "number"
    if shape.data == "pose":
        fits = fits and part.integer("size") in _POSE_SIZES
        wanted = "type: array, size: 3 (x, y and yaw) or 7 (x, y, z and a quaternion)"
    else:
        fits = fits and part.text("unit") in _METRES
        wanted = "type: array, unit: m, with x and y in turn"
    if not fits:
        text = f"transform: {shape.data} does not fit this signal"
        problems.error(shape, "wrong-type", text, hint=f"declare it as {wanted}")
        return None
    return FrameChange(shape.data, frame, "")


def with_frame_changes(signals: Mapping[str, Signal]) -> dict[str, Signal]:
    """Return the signals with complete frame changes.

    The source frame is the frame of the formula's inputs. A change without a source or a tree is
    removed; `urc.config.link.coordinate_frames` reports it.
    """
    tree = next((one.name for one in signals.values() if one.type == "transform_tree"), "")
    found = dict(signals)
    for name, one in signals.items():
        if one.transform is None or one.formula is None:
            continue
        inputs = (signals[each].frame for each in one.formula.names if each in signals)
        frames = {frame for frame in inputs if frame is not None}
        change = None
        if len(frames) == 1 and tree:
            change = one.transform._replace(source=frames.pop(), tree=tree)
        found[name] = one._replace(transform=change)
    return found
