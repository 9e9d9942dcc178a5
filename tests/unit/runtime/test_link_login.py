"""A line whose connection has steps of its own: it is live when they are done, and not before."""

from collections.abc import Iterable

import pytest

from tests.unit.runtime.test_link import opened, state_of
from urc.model.profile import Profile
from urc.model.sequence import ExpectStep, SendStep
from urc.testing.clock import FakeClock
from urc.testing.profile import line_profile, regex, text
from urc.testing.transport import MemoryTransport

pytestmark = pytest.mark.anyio


def with_login(*, polls: bool = False) -> Profile:
    """Return a profile that logs in with a pin, and listens or polls from then on."""
    profile = line_profile(every_s=1.0 if polls else None)
    driver = profile.driver
    steps = (
        SendStep("wire", text("PIN 1")),
        ExpectStep("wire", regex("^WELCOME$"), timeout_s=2.0),
    )
    wire = driver.transports["wire"]._replace(on_connect=steps)
    return profile._replace(driver=driver._replace(transports={"wire": wire}))


async def test_a_robot_that_greets_and_refuses_the_login_is_not_hammered() -> None:
    """A good frame before the login proves nothing: the waits grow all the same."""
    clock = FakeClock()

    class Refuser(MemoryTransport):
        async def open(self, timeout_s: float) -> None:
            await super().open(timeout_s)
            self.feed(b"note hello\n")  # a message that the driver knows
            self.hang_up("bad pin")

    line = Refuser()
    async with opened(line, clock, with_login()) as session:
        await clock.advance(6)
        assert line.opens <= 6
        assert state_of(session) == ("lost", "bad pin")
        assert session.hub.links["wire"].attempts == line.opens


@pytest.mark.parametrize("polls", [False, True])
async def test_a_line_is_live_only_after_its_login(polls: bool) -> None:
    """Whether the robot talks by itself, is polled, or says nothing but its welcome."""

    def answer(data: bytes) -> Iterable[bytes]:
        return [b"42\n"] * data.count(b"%")

    clock, line = FakeClock(), MemoryTransport([b"note hello\n"], answer=answer)
    async with opened(line, clock, with_login(polls=polls)) as session:
        await clock.advance(1.5)
        state, detail = state_of(session)
        assert state == "connecting"
        assert "on_connect steps" in detail
        line.feed(b"WELCOME\n")
        await clock.advance(0.1)
        assert state_of(session) == ("live", "")


async def test_a_line_that_comes_back_is_live_only_after_its_login() -> None:
    """However long it stands."""
    clock, line = FakeClock(), MemoryTransport()
    line.refuse("no route", times=2)
    async with opened(line, clock, with_login()) as session:
        await clock.advance(2.5)
        assert line.is_open
        assert state_of(session)[0] == "connecting"
        assert session.hub.links["wire"].attempts == 2
        line.feed(b"WELCOME\n", b"note hello\n")
        await clock.advance(0.1)
        assert state_of(session) == ("live", "")
        assert session.hub.links["wire"].attempts == 0
