"""A connection test for a robot, which opens each transport once.

Layer 4. The test opens an ordinary session, so it uses the driver's logins, polls and timeouts. The
test does not send motion commands. An on-demand transport that no poll uses is opened and closed
once.
"""

import asyncio
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager, suppress
from typing import Final, Literal, NamedTuple

from urc.model.driver import TransportSpec
from urc.registry import Table
from urc.runtime.connection_cause import Cause, advice_on, cause_of
from urc.runtime.hub import LinkStatus
from urc.runtime.session import Session
from urc.runtime.transport_chain import make_lines, without
from urc.transports.base import TransportError

__all__ = ["LONGEST_S", "ProbeResult", "Verdict", "probe"]

LONGEST_S: Final = 12.0
"""Maximum duration of a test without the orderly close, in seconds, for every driver."""
_ANSWER_S: Final = 4.0
"""Time within which a connected robot must send a frame, in seconds."""
_FIRST_S: Final = 1.0
"""How long a transport must be idle to count as unused by polls, in seconds."""
_LOOK_S: Final = 0.05
_CLOSE_S: Final = 2.0

Verdict = Literal["answers", "opens", "fails"]


class ProbeResult(NamedTuple):
    """The test result of one transport."""

    transport: str
    type: str
    address: str
    """Address for display."""
    verdict: Verdict
    """The result ``answers`` means that the transport is live. The result ``opens`` means that the
    connection opens, but no valid data arrived. On-demand connections through a tunnel get this
    result without a test. The result ``fails`` means that there is no connection."""
    text: str
    """Description of the result, in one line."""
    advice: str
    """Advice for the operator, in one line; "" if the result is good."""
    cause: Cause = ""
    """Cause of a failure; "" if the cause is unknown or the result is good."""


async def probe(
    opened: Callable[[], AbstractAsyncContextManager[Session]],
    table: Table,
    *,
    longest_s: float = LONGEST_S,
) -> list[ProbeResult]:
    """Test every transport of a robot; every wait has a time limit.

    Args:
        opened: function that returns a new session to test.
        table: table of the available transport types.
        longest_s: maximum duration of the test, in seconds.

    Raises:
        UrcError: the session cannot be built with these settings.
    """
    async with opened() as session:
        declared, absent = session.profile.driver.transports, session.absent
        specs = {name: spec for name, spec in declared.items() if name not in absent}
        loop = asyncio.get_running_loop()
        longest = max((one.timeouts.connect_s for one in specs.values()), default=0.0) + _ANSWER_S
        began_s = loop.time()
        until_s = began_s + min(longest, longest_s)
        connected_s: dict[str, float] = {}
        while loop.time() < until_s:
            now_s = loop.time()
            for name, status in session.hub.links.items():
                if _is_connected(status):
                    connected_s.setdefault(name, now_s)
            if all(
                _is_settled(
                    session.hub.links.get(name),
                    now_s - began_s,
                    now_s - connected_s.get(name, now_s),
                )
                for name in specs
            ):
                break
            await asyncio.sleep(_LOOK_S)
        found = dict(session.hub.links)
        idle = [name for name, one in found.items() if one.state == "idle" and not one.attempts]
        lone = await _opened_alone(session, idle, table)
    tried = {name: lone.get(name) or _told(spec, found.get(name)) for name, spec in specs.items()}
    tried |= {name: _failed(declared[name], "", str(fault)) for name, fault in absent.items()}
    return [tried[name] for name in declared]


def _is_connected(status: LinkStatus) -> bool:
    return status.state in ("live", "silent") or (
        status.state == "connecting" and status.detail.startswith("connected")
    )


def _is_settled(status: LinkStatus | None, since_s: float, connected_s: float) -> bool:
    """Return whether the test result of a transport can no longer change.

    Args:
        status: current state of the transport.
        since_s: time since the start of the test, in seconds.
        connected_s: time since the connection opened, in seconds; 0 before it opens.
    """
    if status is None:
        return False
    if status.state in ("live", "lost") or status.attempts:
        return True
    if status.state == "idle":  # without a request; polls send one at once
        return since_s >= _FIRST_S
    return connected_s >= _ANSWER_S


async def _opened_alone(session: Session, names: list[str], table: Table) -> dict[str, ProbeResult]:
    """Test each transport that opens only for requests: open it and close it once."""
    driver = session.profile.driver
    tried: dict[str, ProbeResult] = {}
    if not names:
        return tried
    made = make_lines(without(driver, session.absent), session.settings, table)
    for name in names:
        spec, transport = driver.transports[name], made[name].transport
        if spec.tunnel:
            text = f"is opened through {spec.tunnel} on demand, and was not tested"
            tried[name] = ProbeResult(name, spec.type, transport.address, "opens", text, "")
            continue
        try:
            async with asyncio.timeout(spec.timeouts.connect_s + 1):
                await transport.open(spec.timeouts.connect_s)
            text = "can be opened; commands open the connection on demand"
            tried[name] = ProbeResult(name, spec.type, transport.address, "opens", text, "")
        except (TransportError, TimeoutError) as error:
            text = str(error) or f"not opened within {spec.timeouts.connect_s:g} s"
            tried[name] = _failed(spec, transport.address, text)
        finally:
            with suppress(TimeoutError):
                async with asyncio.timeout(_CLOSE_S):
                    await transport.close()
    return tried


def _told(spec: TransportSpec, status: LinkStatus | None) -> ProbeResult:
    if status is None:
        return _failed(spec, "", "the test ended before this transport was tried")
    if status.state == "live":
        return ProbeResult(spec.name, spec.type, status.address, "answers", "answers", "")
    if _is_connected(status) and not status.attempts:
        text = status.detail or "connected, but a reply is overdue"
        advice = (
            "the replies do not match this driver: check the port and"
            " the robot; many robots serve only one program at a time"
        )
        return ProbeResult(
            spec.name, spec.type, status.address, "opens", text, advice, cause_of(text)
        )
    return _failed(spec, status.address, status.detail or "not connected before the time limit")


def _failed(spec: TransportSpec, address: str, text: str) -> ProbeResult:
    advice, cause = advice_on(text, address), cause_of(text, address)
    return ProbeResult(spec.name, spec.type, address, "fails", text, advice, cause)
