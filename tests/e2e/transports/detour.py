"""A carrier that leads every place to one port of this machine, as the far end of an SSH would."""

from urc.transports._stream_dialer import StreamDialer
from urc.transports.base import ByteStream

__all__ = ["Detour"]


class Detour:
    """Knows ``robot.inside``, which nobody else can look up."""

    def __init__(self, port: int) -> None:
        self._port = port

    async def connect(self, host: str, port: int, timeout_s: float) -> ByteStream:
        assert host == "robot.inside"
        return await StreamDialer("127.0.0.1", self._port).open(timeout_s)
