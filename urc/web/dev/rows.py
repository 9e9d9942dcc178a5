"""Rows of the traffic log: notes, and frames shortened for display.

Layer 5, pure.
"""

import json

import msgspec

from urc.images import MAX_PIXELS, media_type, pixels
from urc.model.payload import Envelope
from urc.runtime.hub import LogEntry, Traffic
from urc.web.wire.text import cut

__all__ = [
    "SHOWN_BYTES",
    "TrafficRow",
    "fill",
    "grouped",
    "note_row",
    "traffic_row",
]

SHOWN_BYTES = 4096
"""Maximum number of bytes displayed for one frame; further bytes are only counted."""
THUMBNAIL_BYTES = 48 * 1024
"""Maximum size of a displayed image, in bytes."""
_SHOWN = ("image/png", "image/jpeg", "image/gif")
_NAMES = ("topic", "action", "service", "method", "path", "url")
"""Attributes that name the source or target of a message, highest priority first."""


class TrafficRow(msgspec.Struct, omit_defaults=True):
    """One row of the traffic log: a frame or a note."""

    n: int
    time_s: float
    """Monotonic time of the row, in seconds; the page receives the row's age instead."""
    kind: str
    """Kind of the row: ``sent``, ``received`` or ``note``."""
    line: str
    """Name of the transport that carried the data."""
    size: int = 0
    data: bytes = b""
    verb: str = ""
    address: str = ""
    more: str = ""
    """Further attributes of the message."""
    text: str = ""
    level: str = ""
    picture: str = ""
    """Media type if `data` is a complete image; otherwise ""."""

    @property
    def weight(self) -> int:
        """Approximate memory used by the row, in bytes."""
        return 100 + len(self.data) + len(self.text) + len(self.more)


def traffic_row(traffic: Traffic) -> TrafficRow:
    """Return a traffic row for sent or received data."""
    row = TrafficRow(0, traffic.time_s, traffic.direction, traffic.transport)
    if traffic.envelope is not None:
        fill(row, traffic.envelope)
    else:
        _fill_bytes(row, traffic.data)
    return row


def note_row(note: LogEntry) -> TrafficRow:
    """Return a traffic row for a fault or a state change."""
    return TrafficRow(0, note.time_s, "note", note.place, level=note.level, text=cut(note.text))


def fill(row: TrafficRow, envelope: Envelope) -> None:
    """Fill a row with the verb, the address, the other attributes and the body of a message."""
    named = [name for name in _NAMES if envelope.attributes.get(name) is not None]
    told = [str(envelope.attributes[name]) for name in named]
    row.verb, row.address = envelope.verb, cut(" ".join(told))
    more = [
        f"{name}={value}"
        for name, value in envelope.attributes.items()
        if value is not None and name not in named
    ]
    row.more = cut(" ".join(more))
    body = envelope.body
    if isinstance(body, bytes):
        _fill_bytes(row, body)
    elif body is not None:
        text = json.dumps(body, default=repr, ensure_ascii=False)
        row.size = len(text.encode("utf-8", "replace"))
        row.text = cut(text)


def _fill_bytes(row: TrafficRow, data: bytes) -> None:
    row.size = len(data)  # size of the displayed text: the length of a secret must not leak
    kind = media_type(data)
    if kind in _SHOWN:
        row.text = f"<{grouped(len(data))} bytes, {kind}>"
        if len(data) <= THUMBNAIL_BYTES and pixels(data) <= MAX_PIXELS:
            row.picture, row.data = kind, data
        return
    row.data = data[:SHOWN_BYTES]


def grouped(number: int) -> str:
    """Return a number with narrow spaces as thousands separators: ``12 345``."""
    return f"{number:,}".replace(",", "\u202f")
