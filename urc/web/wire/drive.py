"""Encoders for the messages about the controls and the decoder for ticks.

Layer 5. `urc.web.wire.messages` documents the direction of each message.
"""

import msgspec

from urc.model.role import includes
from urc.motion.hold_to_run import Reason
from urc.motion.lease import LeaseState, Operator
from urc.motion.link_age import LinkState
from urc.web.wire.text import cut, encoded, milliseconds
from urc.wire.client_messages import (
    Doubled,
    Drive,
    Driving,
    JoinRedundant,
    Release,
    Stop,
    Tick,
    Verb,
)
from urc.wire.server_messages import (
    HeartbeatMessage,
    InputRow,
    LeaseMessage,
    OperatorRow,
    RefusedMessage,
    StoppedMessage,
)

__all__ = [
    "NO_TICK",
    "Doubled",
    "Drive",
    "Driving",
    "Release",
    "JoinRedundant",
    "Stop",
    "Tick",
    "Verb",
    "command_of",
    "decode_tick",
    "encode_beat",
    "encode_lease",
    "encode_refused",
    "encode_stopped",
]


decode_tick = msgspec.json.Decoder(Tick).decode
"""Decoder for probable ticks; raises one of the exceptions in `NO_TICK` for any other text."""
NO_TICK = (msgspec.MsgspecError, UnicodeError, RecursionError)
_TICK_OF = b'{"t":"tick","command":"'
"""First bytes of a page's tick; ticks that begin differently take longer to decode."""


def command_of(data: bytes) -> str:
    """Return the command named in a tick's first bytes; "" if these bytes name no command."""
    end = data.find(b'"', len(_TICK_OF)) if data.startswith(_TICK_OF) else -1
    return data[len(_TICK_OF) : end].decode("ascii", "replace") if end > 0 else ""


def encode_lease(
    state: LeaseState,
    you: Operator,
    *,
    left_s: float,
    is_confirmed: bool,
    spare: str = "",
    override_s: float = 0.0,
) -> str:
    """Return the lease message for a page.

    Args:
        state: the state of the lease.
        you: the page's operator.
        left_s: time until the asking page gets the controls, in seconds.
        is_confirmed: whether the last stop is confirmed.
        spare: key for the page's redundant socket.
        override_s: time for which the holder may still drive without an image, in seconds.
    """
    return encoded(
        LeaseMessage(
            you=you.id,
            name=you.name,
            epoch=state.epoch,
            holder=_person(state.holder),
            asker=_person(state.asked_by),
            left=milliseconds(left_s),
            latched=state.latched_by,
            stops=state.stops,
            confirmed=is_confirmed,
            drives=includes(you.role, "drive"),
            forces=includes(you.role, "maintain"),
            spare=spare if includes(you.role, "drive") else "",
            role=you.role,
            override=milliseconds(override_s),
            limit=you.limit,
        )
    )


def encode_beat(number: int, link: LinkState | None = None) -> str:
    """Return the message with a heartbeat number, which the page must echo.

    `link` is the state of a link from another site; None for a page of this site.
    """
    if link is None:
        return encoded(HeartbeatMessage(number))
    row = InputRow(milliseconds(link.age_s), round(100 * link.share))
    return encoded(HeartbeatMessage(number, row))


def encode_stopped(command: str, reason: Reason) -> str:
    """Return the message that reports that a control was stopped before its release."""
    return encoded(StoppedMessage(command, reason))


def encode_refused(about: str, command: str, message: str) -> str:
    """Return the message that reports a refused tick or a refused request about the controls."""
    return encoded(RefusedMessage(about, cut(message), command))


def _person(client: Operator | None) -> OperatorRow | None:
    return None if client is None else OperatorRow(client.id, client.name)
