"""A socket that carries only the images of one page, no faster than the line delivers them.

Layer 5. Values, replies and the lease use the page's main socket. Images have a socket of their own
(`urc.web.picture_socket`), so a lost packet or a large image delays nothing else. Each message is
sent in parts. The page confirms parts, and `DeliveryWindow` permits the next ones. Each part begins
with one byte, see `LAST` and `CONFIRM`.
"""

import secrets
from collections.abc import Callable
from hmac import compare_digest
from typing import Final

from urc.runtime.clock import Clock
from urc.web.feed.client_socket import FlowControl
from urc.web.feed.delivery_window import LEAST_PART, DeliveryWindow
from urc.web.wire.picture import as_frame

__all__ = ["CONFIRM", "LAST", "PictureLine", "PicturePages"]

LAST: Final = 1
"""Flag of the last part of a message."""
CONFIRM: Final = 2
"""Flag of a part after which the page sends the number of all bytes that it has received."""
_HEAD: Final = [bytes((flags,)) for flags in range(4)]
_DIGITS: Final = 16

TakeLine = Callable[["PictureLine | None"], None]
"""Function of a page that receives its line, and None when the line has ended."""


class PicturePages:
    """The pages of one robot whose images may use a socket of their own, keyed by a secret."""

    def __init__(self) -> None:
        self._pages: dict[str, TakeLine] = {}

    def add(self, take: TakeLine) -> str:
        """Add a page; return the key with which a socket joins it."""
        key = secrets.token_urlsafe(16)
        self._pages[key] = take
        return key

    def remove(self, key: str) -> None:
        """Remove a page."""
        self._pages.pop(key, None)

    def find(self, key: str) -> TakeLine | None:
        """Return the page with a key; None for an unknown key."""
        said = key.encode()
        found = (one for known, one in self._pages.items() if compare_digest(known.encode(), said))
        return next(found, None)


class PictureLine:
    """The sending side of the socket."""

    def __init__(self, flow: FlowControl, clock: Clock) -> None:
        """Prepare the line; `wake` is called whenever more may be sent."""
        self._flow = flow
        self._clock = clock
        self.window = DeliveryWindow(clock.now())
        self.wake: Callable[[], None] = _rest
        self.is_used = True
        """Whether a page uses the line; False after `end`."""
        self._message = memoryview(b"")
        """Rest of the message that is being sent."""
        flow.notify(self._freed)

    def pump(self, next_message: Callable[[], memoryview | None]) -> None:
        """Send messages while the window and the socket permit it.

        `next_message` returns the newest message for the page; None if the page has all messages.
        """
        window, flow = self.window, self._flow
        while flow.is_free():
            if not self._message:
                # An image that is chosen before it may leave becomes outdated.
                if not window.allows(LEAST_PART):
                    return
                message = next_message()
                if message is None:
                    return
                self._message = message
            size = min(len(self._message), window.part_bytes - 1)
            if not window.allows(size + 1):
                return
            part, self._message = self._message[:size], self._message[size:]
            flags = 0 if self._message else LAST
            if window.sends(size + 1, self._clock.now()):
                flags |= CONFIRM
            flow.write(as_frame(_HEAD[flags] + part))

    def confirmed(self, data: bytes) -> bool:
        """Handle a page's confirmation; return False for any other message."""
        if not (data.isdigit() and len(data) <= _DIGITS):
            return False
        if not self.window.confirmed(int(data), self._clock.now()):
            return False
        self.wake()
        return True

    def end(self) -> None:
        """Close the socket, because its page has closed or has opened a newer one."""
        self.wake, self.is_used = _rest, False
        self._flow.abort()

    def _freed(self) -> None:
        self.wake()


def _rest() -> None:
    """Do nothing, because no page uses the line."""
