"""Constant frames that their own framing cannot carry: told when a document is checked, not later.

Frames with expressions in them are checked when they are made.
"""

from typing import cast

from urc.config.forms import write_form
from urc.config.part import Findings, Part
from urc.expressions import ExpressionError
from urc.model.codec import WriteSpec
from urc.model.driver import Driver, FramingSpec, TransportSpec
from urc.model.framing import FrameLayout

__all__ = ["check_frames"]


def check_frames(part: Part, driver: Driver, findings: Findings) -> None:
    """Report constant texts under ``send:`` that would be two frames, or none."""
    for name, inner in part.named("commands").items():
        command = driver.commands.get(name)
        if command is not None:
            _check(inner, command.send, driver.transports.get(command.transport), findings)
    for inner, poll in zip(part.listed("polls"), driver.polls, strict=True):
        _check(inner, poll.send, driver.transports.get(poll.transport), findings)


def _check(part: Part, send: WriteSpec, spec: TransportSpec | None, findings: Findings) -> None:
    written = part.get("send")
    if spec is None or written is None or send.form != "text":
        return
    inner, form = write_form(written)
    templates = [template for _, template in form.templates(inner, send)]
    if len(templates) != 1 or not templates[0].is_constant:
        return
    try:
        data = templates[0].render({}).encode(spec.encoding)
    except (ExpressionError, UnicodeEncodeError):
        return  # told elsewhere
    framing = spec.framing.sent or spec.framing
    layout = cast("FrameLayout | None", framing.options.get("layout")) or FrameLayout()
    for mark in _marks(framing, layout):
        if mark and mark in data:
            findings.error(
                inner,
                "contains-delimiter",
                f"the text has {_shown(mark)} in it, which the framing puts around each frame:"
                " it would be two frames",
                hint="take it away: the framing adds what marks a frame",
            )
            return
    wanted = None if layout.size is None else layout.size - layout.head - layout.tail
    if wanted is not None and wanted != len(data):
        findings.error(
            inner,
            "wrong-size",
            f"the text has {len(data)} bytes, and a frame of this line holds exactly {wanted}",
        )


def _marks(framing: FramingSpec, layout: FrameLayout) -> tuple[bytes, ...]:
    if framing.type == "brackets":
        return layout.start, layout.end
    if framing.type in ("delimiter", "regex"):
        return (cast("bytes", framing.options.get("tx", b"")),)
    return ()


def _shown(mark: bytes) -> str:
    return {b"\n": "LF", b"\r": "CR", b"\r\n": "CRLF"}.get(mark, ascii(mark.decode("latin-1")))
