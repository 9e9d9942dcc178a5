"""The failure of a command.

Layer 4. The module contains only this exception, so that clients of a server can import it without
the engine.
"""

from urc.problems import UrcError

__all__ = ["CommandFailed"]


class CommandFailed(UrcError):
    """The failure of a command.

    `code` is a failure code of `urc.protocol.events.Failed`, such as ``timed-out`` or ``refused``,
    or a code that a client adds, such as ``busy``. `message` is text for display.
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message
