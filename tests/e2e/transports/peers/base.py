"""What the contract asks of the far end of a transport: a robot that does as it is told.

A peer is started with one way to behave and gives a transport that leads to it. Everything it opens
(sockets, tasks, processes) is gone after `stop`: the contract counts.
"""

from typing import Literal, NamedTuple, Protocol

from urc.model.payload import Payload
from urc.transports.base import Transport

__all__ = ["Behaviour", "Peer", "Traits", "WAIT_S"]

WAIT_S = 20.0
"""Bound of every wait in the tests that is none of the transport's own."""

Behaviour = Literal[
    "echo",  # what is sent comes back: `Peer.ask` is answered by `Peer.answer`
    "closes",  # takes one payload, then closes the line in good order
    "silent",  # opens in good order, takes everything and says nothing
    "drips",  # as echo, in the smallest pieces the transport has, a moment apart
    "floods",  # from the first payload on it says `Peer.answer` as fast as it can, for ever
    "deaf",  # opens in good order and takes nothing
    "mute",  # `open` gets no answer: at most a bare connection, and then nothing
    "refuses",  # nobody is there
]


class Traits(NamedTuple):
    """What a kind of transport can know. Each False needs its reason in the peer's docstring."""

    is_stream: bool = True
    """Bytes may come in other pieces than they were sent in."""
    open_can_wait: bool = True
    """`open` needs something from the robot; False: "mute" is never asked for."""
    refusal: Literal["open", "use"] = "open"
    """Who tells that nobody is there: `open`, or what comes after the first `send`."""
    tells_close: bool = True
    """`receive` raises PeerClosed when the robot closes."""
    tells_vanishing: bool = True
    """`receive` raises PeerClosed when a robot that is sent to is gone without a word."""
    pushes_back: bool = True
    """`send` waits when the robot takes nothing; False: what it does not take is lost."""


class Peer(Protocol):
    """One robot for one test. Made without arguments; may need root for `vanish`."""

    traits: Traits
    ask: Payload
    answer: Payload
    """What an echoing peer makes of `ask`, as `receive` returns it."""

    async def start(self, behaviour: Behaviour) -> Transport:
        """Start, and return a closed transport that leads here; called once."""

    async def vanish(self) -> None:
        """Lose every packet between the two, in both directions, until `stop`."""

    async def stop(self) -> None:
        """Take everything down, whatever state it is in. Never raises."""
