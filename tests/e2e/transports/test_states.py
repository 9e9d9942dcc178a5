"""A driver sees the same states, and the same shape of reason, whichever transport carries it."""

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.peers.base import WAIT_S, Behaviour, Traits
from tests.e2e.transports.test_contract import PEERS, class_of
from urc.model.driver import Backoff, Driver, FramingSpec, Poll, Reply, Timeouts, TransportSpec
from urc.model.profile import Profile
from urc.model.values import Signal
from urc.runtime.hub import LinkStatus
from urc.runtime.session import Session
from urc.testing.profile import regex, text
from urc.testing.transport import table_of

pytestmark = pytest.mark.anyio

CARRIES_BYTES = [kind for kind in PEERS if isinstance(class_of(kind).ask, bytes)]
TELLS_CLOSE = [kind for kind in CARRIES_BYTES if class_of(kind).traits.tells_close]


def profile_for(ask: bytes, traits: Traits) -> Profile:
    """Return a robot that is asked `ask` again and again, and whose echo is its answer."""
    question = ask.decode().rstrip("\n")
    framing = FramingSpec("delimiter", {"tx": b"\n", "rx": b"\n"})
    reply = Reply(regex(f"^(?P<word>{re.escape(question)})$"))
    driver = Driver(
        transports={
            "wire": TransportSpec(
                name="wire",
                type="tcp",
                framing=framing if traits.is_stream else FramingSpec("datagram"),
                timeouts=Timeouts(connect_s=2.0, reply_s=0.5),
                backoff=Backoff(initial_s=0.05, max_s=0.2),
            )
        },
        signals={"word": Signal("word", "string")},
        polls=(Poll("polls.0", "wire", 0.2, text(question), reply),),
    )
    return Profile("robot", "Robot", "robot.yaml", driver=driver)


@asynccontextmanager
async def driven(kind: str, behaviour: Behaviour) -> AsyncIterator[Session]:
    """Drive a robot that behaves in that way; nothing of either is left afterwards."""
    peer = class_of(kind)()
    async with nothing_left():
        try:
            transport = await peer.start(behaviour)
            assert isinstance(peer.ask, bytes)
            profile = profile_for(peer.ask, peer.traits)
            async with Session(profile, {}, table_of(tcp=transport)) as session:
                yield session
        finally:
            await peer.stop()


async def until(session: Session, state: str, attempts: int = 0) -> LinkStatus:
    """Wait for the state of the line, and return all about it."""
    with session.hub.subscribe() as subscription:
        async with asyncio.timeout(2 * WAIT_S):
            while True:
                link = session.hub.links["wire"]
                if link.state == state and link.attempts >= attempts:
                    return link
                subscription.changes()
                await subscription.changed()


def is_told(detail: str) -> bool:
    """Return whether people can read it: one line, in lower case, without codes."""
    return bool(re.fullmatch(r"[^A-Z\n<>]?[^\n<>]{8,200}", detail)) and "Errno" not in detail


@pytest.mark.parametrize("kind", CARRIES_BYTES)
async def test_robot_that_answers_is_live(kind: str) -> None:
    async with driven(kind, "echo") as session:
        await until(session, "live")
        reading = session.hub.latest("word")
        assert reading is not None


@pytest.mark.parametrize("kind", CARRIES_BYTES)
async def test_robot_that_is_not_there_is_lost(kind: str) -> None:
    """With a reason, and called again and again."""
    async with driven(kind, "refuses") as session:
        link = await until(session, "lost", attempts=3)
        assert is_told(link.detail), link.detail


@pytest.mark.parametrize("kind", CARRIES_BYTES)
async def test_robot_that_says_nothing_is_silent(kind: str) -> None:
    async with driven(kind, "silent") as session:
        link = await until(session, "silent")
        assert is_told(link.detail), link.detail


@pytest.mark.parametrize("kind", TELLS_CLOSE)
async def test_robot_that_closes_is_lost(kind: str) -> None:
    async with driven(kind, "closes") as session:
        link = await until(session, "lost")
        assert is_told(link.detail), link.detail
