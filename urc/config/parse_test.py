"""A test that a document carries about itself: mapping → `DocumentTest`."""

from urc.config.part import Findings, Part
from urc.model.profile import DocumentTest, Fed
from urc.model.values import Value

__all__ = ["parse_test"]


def parse_test(part: Part, findings: Findings) -> DocumentTest:
    """Return one test; what it names is looked up when names are linked."""
    mark, home = part.document.at(part.path), part.document.source_of(part.path)
    line, column = (mark.span.line, mark.span.column) if mark else (1, 1)
    reply_to = part.scalar("reply_to")
    if isinstance(reply_to, float):
        reply_to = int(reply_to)
    return DocumentTest(
        name=part.text("name"),
        line=line,
        feed={name: _fed(inner, findings) for name, inner in part.named("feed").items()},
        reply_to=reply_to,
        run=part.text("run") or None,
        arguments={name: inner.data for name, inner in part.named("args").items()},
        expect={name: _expected(inner) for name, inner in part.named("expect").items()},
        sent={name: _wire(inner, findings) for name, inner in part.named("sent").items()},
        fails=part.text("fails") or None,
        file=home.file,
        column=column,
        source=home.lines[line - 1],
        settings={name: inner.data for name, inner in part.named("settings").items()},
    )


def _expected(part: Part) -> Value | tuple[Value, ...]:
    return tuple(part.data) if isinstance(part.data, list) else part.data


def _fed(part: Part, findings: Findings) -> Fed | tuple[Fed, ...]:
    if isinstance(part.data, list):
        return tuple(_wire(inner, findings) for inner in part.items())
    return _wire(part, findings)


def _wire(part: Part, findings: Findings) -> Fed:
    """Return text, or the bytes under ``hex``."""
    if not isinstance(part.data, dict):
        return str(part.data)
    inner = part.must("hex")
    try:
        return bytes.fromhex(inner.data)
    except ValueError:
        text = "these are no pairs of hex digits"
        hint = "write each byte as two digits: 02 FF 0D"
        findings.error(inner, "not-hex", text, hint=hint)
        return b""
