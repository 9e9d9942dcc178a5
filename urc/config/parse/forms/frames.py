"""Several frames for one command: each item in a list under ``send:`` has a form."""

from collections.abc import Iterable

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext, write_form
from urc.expressions import COUNTERS, Template
from urc.model.payload import WriteSpec, each_of

__all__ = ["parse_write", "templates"]


def parse_write(part: Node, problems: Problems, context: FormContext) -> WriteSpec | None:
    """Return the frames at `part`, in list order."""
    if context.framing is not None and context.framing.type == "datagram":
        problems.error(
            part,
            "many-frames",
            "several frames of one command are sent together, but each frame is a separate"
            " message on this transport",
            hint="write a command for each frame; on a byte stream, declare a 'framing' instead",
        )
        return None
    frames: list[WriteSpec] = []
    for item in part.items():
        inner, form = write_form(item)
        found = form.parse_write(inner, problems, context)
        if found is None:
            return None
        if found.form == "envelope":
            text = "this frame is a separate message, and cannot be sent together with other frames"
            problems.error(item, "many-frames", text, hint="write a command for each frame")
        elif COUNTERS in found.names:
            text = "a frame with a counter cannot be sent together with other frames"
            problems.error(item, "many-frames", text, hint="write a command for each frame")
        frames.append(found)
    return WriteSpec(
        "frames",
        {"frames": tuple(frames)},
        frozenset[str]().union(*(one.names for one in frames)),
        frozenset[str]().union(*(one.settings for one in frames)),
    )


def templates(part: Node, spec: WriteSpec) -> Iterable[tuple[Node, Template]]:
    """Return every template of all frames, with its position."""
    for item, one in zip(part.items(), each_of(spec), strict=True):
        inner, form = write_form(item)
        yield from form.templates(inner, one)
