"""The messages of one line: which of them a frame is.

Floor 3, pure. The first one declared that takes a frame has it. A frame is offered only to those
whose literal beginning it has: most drivers have many messages, and a frame is one of them.
"""

from collections.abc import Mapping, Sequence
from typing import Final

from urc.model.codec import Payload
from urc.protocol.answer import Matcher
from urc.protocol.codec import Frame
from urc.protocol.fast_value import FastRead, Taken

__all__ = ["WARM_AFTER", "Messages"]

WARM_AFTER: Final = 30
"""Frames after which functions are made: a test of a document is over before that."""
_BLANKS = frozenset(blank.encode() for blank in ("", *" \t\r\n\f\v\x1c\x1d\x1e\x1f"))


class Messages:
    """The messages of one line, in the order of the document."""

    def __init__(self, messages: Sequence[Matcher], encoding: str) -> None:
        self._all = tuple(messages)
        self._encoding = encoding
        self._frames = 0
        self._table: _Table | None = None

    @property
    def declared(self) -> tuple[Matcher, ...]:
        """What was declared, in the order of the document."""
        return self._all

    @property
    def alone(self) -> tuple[Mapping[bytes, FastRead], int]:
        """Beginnings of frames that one message alone may take, with its function; their length."""
        table = self._table
        if table is None:
            return {}, 0
        return table.only, table.length

    def take(self, payload: Payload, now: float, frame: Frame | None = None) -> Taken | None:
        """Return what a frame says, or None when it is none of the messages.

        Args:
            payload: of the frame.
            now: when it came.
            frame: the same, where it is already made; its ``fault`` is set when a message knew it
                and could not take it.
        """
        table = self._table
        if table is not None and type(payload) is bytes:
            only = table.only.get(payload[: table.length])
            if only is not None:
                taken = only(payload, now)
                if taken or frame is None:
                    return taken
        return self._other(payload, now, frame)

    def _other(self, payload: Payload, now: float, frame: Frame | None) -> Taken | None:
        """Do what `take` does where it is not one message alone that may take the frame."""
        table = self._table
        if table is None:
            self._frames += 1
            if self._frames == WARM_AFTER:
                self._table = _Table(self._all, self._encoding)
            return self._any(self._all, payload, now, frame)
        if type(payload) is not bytes:
            return self._any(self._all, payload, now, frame)
        head = payload[: table.length]
        if head in table.only:
            return self._any(self._all, payload, now, frame)  # for what is to be said of it
        candidates = table.by_head.get(head)
        if candidates is None:
            # Blanks before the text are nobody's literal, but some forms take them.
            candidates = table.every if head[:1] in _BLANKS else table.others
        for place, (_, fast) in enumerate(candidates):
            if fast is None:
                rest = [one for one, _ in candidates[place:]]
                return self._any(rest, payload, now, frame)
            taken = fast(payload, now)
            if taken is not None:
                return taken
        # Once more, for what is to be said of it.
        return None if frame is None else self._any(self._all, payload, now, frame)

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

    def __init__(self, messages: Sequence[Matcher], encoding: str) -> None:
        rows: list[_Row] = [(one, one.make_fast() if one.make_fast else None) for one in messages]
        # Elsewhere a text may begin with a mark, or in more ways than one.
        has_heads = encoding in ("utf-8", "ascii", "latin-1")
        starts = [one.prefix.encode(encoding) if has_heads else b"" for one in messages]
        self.length = min((len(start) for start in starts if start), default=0)
        """Bytes of a head."""
        self.every = tuple(rows)
        self.others = tuple(row for row, start in zip(rows, starts, strict=True) if not start)
        """Those of which it is not known how their frames begin."""
        heads = dict.fromkeys(start[: self.length] for start in starts if start)
        self.by_head = {
            head: tuple(
                row
                for row, start in zip(rows, starts, strict=True)
                if not start or start.startswith(head)
            )
            for head in heads
        }
        self.only = {
            head: found[0][1]
            for head, found in self.by_head.items()
            if len(found) == 1 and found[0][1] is not None
        }
        """Where one message alone can be meant: its function."""
        if len(rows) == 1 and rows[0][1] is not None and not heads:
            self.only[b""] = rows[0][1]
