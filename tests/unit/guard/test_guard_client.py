"""The client of the guard: its one table of held commands, and what it tells a guard."""

import pytest
from msgspec.structs import replace

from tests.unit.guard.lines import CountedWire
from urc.guard import messages
from urc.guard.channel import ChannelListener, GuardedLineSpec
from urc.guard.guard_client import GuardClient, HeldSpec
from urc.model.payload import Count, FrameVariants, Numbered, Payload
from urc.motion.hold_to_run import LEASE_S, HoldTerms
from urc.problems import UrcError
from urc.transports.base import GoalRecord

pytestmark = pytest.mark.anyio

TERMS = HoldTerms(b"stop", period_s=0.05)
SERIES = FrameVariants(
    (Numbered(b"7 stop", Count({}, {"n": 7})), Numbered(b"8 stop", Count({"n": 7}, {"n": 8})))
)


class FakeChannel:
    """Keeps the messages and calls that it gets; no guard is behind it."""

    def __init__(self, listener: ChannelListener) -> None:
        self.listener = listener
        self.told: list[object] = []
        self.time_s = 0.0

    def start(self) -> None:
        self.told.append("start")

    async def finish(self) -> None:
        self.told.append("finish")

    def post(self, message: messages.ToGuard, *, slot: str = "", is_urgent: bool = False) -> None:
        assert is_urgent is isinstance(message, messages.StopMotion)
        self.told.append(message)

    def drop(self, slot: str) -> None:
        pass

    async def ready(self) -> None:
        pass

    def now(self) -> float:
        return self.time_s


HELD = {
    "drive": HeldSpec("wire", HoldTerms(b"", 0.05, LEASE_S, is_lossy=False)),
    "lift": HeldSpec("air", HoldTerms(b"", 0.05, LEASE_S, is_lossy=True)),
}


@pytest.fixture
def guard() -> GuardClient:
    return GuardClient([], HELD, FakeChannel)


def render(command: str) -> Payload:
    return f"{command} stop".encode()


def told(guard: GuardClient) -> list[object]:
    """Return the messages and calls since this was last asked."""
    assert isinstance(guard.channel, FakeChannel)
    found, guard.channel.told = guard.channel.told, []
    return found


def test_a_new_guard_learns_the_goals_that_the_last_one_reported() -> None:
    make = messages.MakeTransport("ros", "a.b:c", {}, [], "", 0.25, True)
    guard = GuardClient([GuardedLineSpec(make, CountedWire())], {}, FakeChannel)
    assert list(guard.briefing()) == [make]
    record = GoalRecord((("a1", "/dock", False),), ("/undock",))
    for one in (GoalRecord(), record):
        guard.handle(messages.GoalsChanged("ros", one), 0)
    for _ in range(2):
        guard.lost("the guard ended")
        assert list(guard.briefing()) == [replace(make, goals=record)]


async def test_control_is_armed_on_its_line(guard: GuardClient) -> None:
    guard.start()
    guard.arm("drive", TERMS)
    guard.arm("lift", TERMS)
    guard.release("drive")
    await guard.finish()
    assert told(guard) == [
        "start",
        messages.ArmControl("wire", "drive", TERMS),
        messages.ArmControl("air", "lift", TERMS),
        messages.ReleaseControl("drive"),
        "finish",
    ]


def test_terms_that_stop_nothing_arm_nothing(guard: GuardClient) -> None:
    with pytest.raises(UrcError, match=r"^drive: a lease lasts 0\.1 to 1\.0 s, not 5$"):
        guard.arm("drive", TERMS._replace(lease_s=5.0))
    guard.renew("drive", b"later")
    guard.tick("drive", b"go")
    guard.stop_all(render)
    assert told(guard) == []
    assert list(guard.briefing()) == []


def test_stop_goes_by_the_terms_of_what_is_armed(guard: GuardClient) -> None:
    """With the newest frame, and the others as they were."""
    terms = TERMS._replace(period_s=0.3, lease_s=0.4)
    guard.arm("drive", terms)
    guard.stop({"drive": b"stop 2"})
    guard.stop({"drive": SERIES})
    stops = {"stop": b"7 stop", "stops": SERIES.frames}
    assert told(guard)[1:] == [
        messages.StopMotion([("wire", "drive", terms._replace(stop=b"stop 2"))]),
        messages.StopMotion([("wire", "drive", terms._replace(**stops))]),
    ]


def test_all_that_may_move_is_stopped_by_the_frames_of_now(guard: GuardClient) -> None:
    """Or by the newest that there was, where none can be made any more."""
    guard.arm("drive", TERMS)
    guard.arm("lift", TERMS)
    guard.tick("drive", b"go")
    told(guard)
    guard.stop_all(render)
    assert told(guard) == [
        messages.StopMotion([("wire", "drive", TERMS._replace(stop=b"drive stop"))])
    ]
    guard.tick("lift", b"up")
    guard.renew("drive", b"stop 7")
    guard.renew("lift", SERIES)
    told(guard)

    def broken(command: str) -> Payload:
        raise UrcError("no such setting")

    guard.stop_all(broken)
    numbered = TERMS._replace(stop=b"7 stop", stops=SERIES.frames)
    assert told(guard) == [
        messages.StopMotion(
            [("wire", "drive", TERMS._replace(stop=b"stop 7")), ("air", "lift", numbered)],
        )
    ]


async def test_a_stop_that_is_due_again_needs_a_new_gesture(guard: GuardClient) -> None:
    """Reported once; a control that may move, or that is unknown, has no lost stop."""
    guard.handle(messages.StopDue("nothing"), 0)
    guard.arm("drive", TERMS)
    guard.tick("drive", b"go")
    guard.handle(messages.StopDue("drive"), 0)
    guard.handle(messages.StopWritten("drive", "released", 1), 0)
    guard.handle(messages.StopDue("drive"), 0)
    assert await guard.stops() == (("drive", "released"), ("drive", "lost"))
    told(guard)
    guard.tick("drive", b"go")
    assert told(guard) == []
    guard.arm("drive", TERMS)
    guard.tick("drive", b"go")
    assert messages.ArmControl("wire", "drive", TERMS) in told(guard)
    assert guard.is_armed("drive")


def test_a_new_guard_numbers_ticks_from_one(guard: GuardClient) -> None:
    """So a stop at the first tick disarms the control."""
    guard.arm("drive", TERMS)
    assert list(guard.briefing()) == [messages.ArmControl("wire", "drive", TERMS)]
    guard.tick("drive", b"go")
    guard.handle(messages.StopWritten("drive", "expired", 1), 0)
    assert not guard.is_armed("drive")


def test_stop_of_what_was_never_armed_has_the_terms_of_its_line(guard: GuardClient) -> None:
    """STOP needs no gesture; on lines that may lose it, it is repeated."""
    guard.stop({"drive": b"halt", "lift": b"down"})
    guard.stop({})
    assert told(guard) == [
        messages.StopMotion(
            [
                ("wire", "drive", HoldTerms(b"halt", 0.05, LEASE_S, is_lossy=False)),
                ("air", "lift", HoldTerms(b"down", 0.05, LEASE_S, is_lossy=True)),
            ]
        )
    ]


def test_tick_says_when_the_image_of_its_operator_is_too_old(guard: GuardClient) -> None:
    """On the clock of the guard; a tick of a command without image says nothing of the kind."""
    guard.arm("drive", TERMS)
    guard.channel.time_s = 7.0  # type: ignore[attr-defined]
    guard.tick("drive", b"go")
    guard.tick("drive", b"go", 0.5)
    ticks = [one for one in guard.channel.told if isinstance(one, messages.RenewLease)]  # type: ignore[attr-defined]
    assert [one.until_s for one in ticks] == [float("inf"), 7.5]
