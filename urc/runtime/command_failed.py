"""The failure of a command.

Layer 4. The error has a separate module, because clients of a server need it without the engine.
"""

from urc.problems import UrcError

__all__ = ["CommandFailed"]


class CommandFailed(UrcError):
    """The failure of a command.

    `code` is ``timed-out``, ``refused``, ``disconnected``, ``bad-argument``, ``queue-full`` or
    ``unknown-command``; a server adds ``busy`` and ``not-confirmed``. `message` is for display.
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message
