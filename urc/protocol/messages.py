"""The messages of one line: which of them a frame is.

Floor 3, pure. The first one declared that takes a frame has it. A frame is offered only to those
whose literal beginning it has: most drivers have many messages, and a frame is one of them.
"""

from collections.abc import Sequence
from typing import Final

from urc.model.codec import Payload
from urc.protocol.exchange import Matcher
from urc.protocol.fast_read import FastRead, Taken
from urc.protocol.forms import Frame

__all__ = ["WARM_AFTER", "Messages"]

WARM_AFTER: Final = 30
"""Frames after which functions are made: a test of a document is over before that."""

_BLANKS = frozenset(" \t\r\n\f\v\x1c\x1d\x1e\x1f")


class Messages:
    """The messages of one line, in the order of the document."""

    def __init__(self, messages: Sequence[Matcher], encoding: str) -> None:
        self._all = tuple(messages)
        self._encoding = encoding
        self._frames = 0
        self._table: _Table | None = None

    def take(self, payload: Payload, now: float, frame: Frame | None = None) -> Taken | None:
        """Return what a frame says, or None when it is none of the messages.

        Args:
            payload: of the frame.
            now: when it came.
            frame: the same, where it is already made; its ``fault`` is set when a message knew it
                and could not take it.
        """
        table = self._table
        if table is None:
            self._frames += 1
            if self._frames == WARM_AFTER:
                self._table = _Table(self._all)
            return self._any(self._all, payload, now, frame)
        if not table.needs_text or not isinstance(payload, bytes):
            return self._any(self._all, payload, now, frame)
        try:
            text = payload.decode(self._encoding)
        except UnicodeDecodeError:
            return self._any(self._all, payload, now, frame)
        head = text[: table.length]
        only = table.only.get(head)
        if only is not None:
            return only(text, now, payload)
        candidates = table.by_head.get(head)
        if candidates is None:
            # Blanks before the text are nobody's literal, but some forms take them.
            candidates = table.every if text[:1] in _BLANKS else table.others
        for place, (_, fast) in enumerate(candidates):
            if fast is None:
                rest = [one for one, _ in candidates[place:]]
                return self._any(rest, payload, now, frame)
            taken = fast(text, now, payload)
            if taken is not None:
                return taken
        return None

    def _any(
        self, candidates: Sequence[Matcher], payload: Payload, now: float, frame: Frame | None
    ) -> Taken | None:
        if frame is None:
            frame = Frame(payload, self._encoding)
        for one in candidates:
            taken = one.take(frame, now)
            if taken is not None:
                return taken
        return None


_Row = tuple[Matcher, FastRead | None]


class _Table:
    """What is made once it pays: a function for each message, found by how a frame begins."""

    def __init__(self, messages: Sequence[Matcher]) -> None:
        rows: list[_Row] = [(one, one.make_fast() if one.make_fast else None) for one in messages]
        prefixes = [one.prefix for one in messages if one.prefix]
        self.length = min(map(len, prefixes), default=0)
        """Characters of a head."""
        self.every = tuple(rows)
        self.others = tuple(row for row in rows if not row[0].prefix)
        """Those of which it is not known how their frames begin."""
        self.by_head = {
            head: tuple(row for row in rows if not row[0].prefix or row[0].prefix.startswith(head))
            for head in dict.fromkeys(prefix[: self.length] for prefix in prefixes)
        }
        self.only = {
            head: found[0][1]
            for head, found in self.by_head.items()
            if len(found) == 1 and found[0][1] is not None
        }
        """Where one message alone can be meant: its function."""
        self.needs_text = any(one.prefix or fast for one, fast in rows)
