"""What a desk moves goes to the guard under the right name, line and terms."""

from collections.abc import Sequence
from typing import Any

import pytest

from tests.unit.runtime.desks import DRIVER, held
from urc.expressions import compile_template
from urc.guard.client import Guard, LineSpec, LocalGuard
from urc.guard.side import Client
from urc.model.codec import Count, Numbered, Payload, ReadSpec, Series
from urc.model.driver import Driver, Message, TransportSpec
from urc.motion.hold import LEASE_S, Reason, Terms
from urc.motion.stall import STALLED_S, WAITED_S
from urc.problems import UrcError
from urc.registry import Table
from urc.runtime import guarding
from urc.runtime.guarding import GuardedMovers, take_reins
from urc.testing.clock import FakeClock
from urc.testing.movers import FakeFrames
from urc.transports.base import Setup

pytestmark = pytest.mark.anyio

TERMS = Terms(b"stop", period_s=0.05)
SERIES = Series(
    (Numbered(b"7 stop", Count({}, {"n": 7})), Numbered(b"8 stop", Count({"n": 7}, {"n": 8})))
)


class FakeClient(Client):
    """Keeps what it is told."""

    def __init__(self) -> None:
        super().__init__([])
        self.told: list[tuple[Any, ...]] = []
        self.moving: set[str] = set()
        self.transports = {"wire": type("Line", (), {"is_open": True})()}

    def start(self) -> None:
        self.told.append(("start",))

    async def finish(self) -> None:
        self.told.append(("finish",))

    def arm(self, line: str, control: str, terms: Terms) -> None:
        self.told.append(("arm", line, control, terms))

    def renew(self, control: str, stop: object) -> None:
        self.told.append(("renew", control, stop))

    def is_stopping(self, control: str) -> bool:
        return control in self.moving

    def release(self, control: str) -> None:
        self.told.append(("release", control))

    def stop(self, controls: Sequence[tuple[str, str, Terms]]) -> None:
        self.told.append(("stop", *controls))

    async def stops(self) -> Sequence[tuple[str, Reason]]:
        return [("drive", "expired")]


@pytest.fixture
def client() -> FakeClient:
    return FakeClient()


@pytest.fixture
def movers(client: FakeClient) -> GuardedMovers:
    return GuardedMovers(DRIVER, client)


async def test_control_is_armed_on_its_line(client: FakeClient, movers: GuardedMovers) -> None:
    movers.start()
    movers.arm("drive", TERMS)
    movers.arm("lift", TERMS)
    movers.release("drive")
    await movers.finish()
    assert client.told == [
        ("start",),
        ("arm", "wire", "drive", TERMS),
        ("arm", "air", "lift", TERMS),
        ("release", "drive"),
        ("finish",),
    ]
    assert await movers.stops() == [("drive", "expired")]
    assert movers.transports is client.transports
    assert movers.is_open("drive")


def test_terms_that_stop_nothing_arm_nothing(client: FakeClient, movers: GuardedMovers) -> None:
    with pytest.raises(UrcError, match=r"^drive: a lease lasts 0\.1 to 1\.0 s, not 5$"):
        movers.arm("drive", TERMS._replace(lease_s=5.0))
    movers.renew("drive", b"later")
    movers.stop_all(FakeFrames(DRIVER))
    assert client.told == []


def test_stop_goes_by_the_terms_of_what_is_armed(client: FakeClient, movers: GuardedMovers) -> None:
    """With the newest frame, and the others as they were."""
    terms = TERMS._replace(period_s=0.3, lease_s=0.4)
    movers.arm("drive", terms)
    movers.stop({"drive": b"stop 2"})
    movers.stop({"drive": SERIES})
    stops = {"stop": b"7 stop", "stops": SERIES.frames}
    assert client.told[1:] == [
        ("stop", ("wire", "drive", terms._replace(stop=b"stop 2"))),
        ("stop", ("wire", "drive", terms._replace(**stops))),
    ]


def test_all_that_may_move_is_stopped_by_the_frames_of_now(
    client: FakeClient, movers: GuardedMovers
) -> None:
    """Or by the newest that there was, where none can be made any more."""
    frames = FakeFrames(DRIVER)
    movers.arm("drive", TERMS)
    movers.arm("lift", TERMS)
    client.moving = {"drive"}
    movers.stop_all(frames)
    client.moving = {"drive", "lift"}
    movers.renew("drive", b"stop 7")
    movers.renew("lift", SERIES)

    def broken(command: str) -> Payload:
        raise UrcError("no such setting")

    frames.stop_frame = broken  # type: ignore[method-assign]
    movers.stop_all(frames)
    numbered = TERMS._replace(stop=b"7 stop", stops=SERIES.frames)
    assert client.told[2:] == [
        ("stop", ("wire", "drive", TERMS._replace(stop=b"drive stop"))),
        ("renew", "drive", b"stop 7"),
        ("renew", "lift", SERIES),
        ("stop", ("wire", "drive", TERMS._replace(stop=b"stop 7")), ("air", "lift", numbered)),
    ]


def test_stop_of_what_was_never_armed_has_the_terms_of_its_line(
    client: FakeClient, movers: GuardedMovers
) -> None:
    """STOP needs no gesture; on lines that may lose it, it is repeated."""
    movers.stop({"drive": b"halt", "lift": b"down"})
    movers.stop({})
    assert client.told == [
        (
            "stop",
            ("wire", "drive", Terms(b"halt", 0.05, LEASE_S, is_lossy=False)),
            ("air", "lift", Terms(b"down", 0.05, LEASE_S, is_lossy=True)),
        )
    ]


# -- lines


class Stub:
    """A transport that is never opened."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.address = f"stub {setup.name}"


KINDS = ("tcp", "udp", "serial", "mqtt", "rosbridge", "ssh")
TABLE = Table("urc.transports", dict.fromkeys(KINDS, f"{__name__}:Stub"))


def lines_of(client: Client) -> Sequence[LineSpec]:
    return client._lines


def reins(driver: Driver, *, is_guarded: bool = False) -> GuardedMovers:
    return take_reins(driver, {}, TABLE, FakeClock(), is_guarded=is_guarded)


def robot(kind: str, *on_stall: str, via: str = "") -> Driver:
    """Return a robot with a line of a kind, and controls on it that say this of a stall."""
    commands = {}
    for number, said in enumerate(on_stall):
        one = held(f"c{number}")
        assert one.hold is not None
        commands[one.name] = one._replace(hold=one.hold._replace(on_stall=said))
    away = held("away", "other")
    assert away.hold is not None
    commands["away"] = away._replace(hold=away.hold._replace(on_stall="abort"))
    specs = {
        "other": TransportSpec("other", "tcp"),
        "wire": TransportSpec("wire", kind, via=via),
    }
    return Driver(specs, commands=commands)


@pytest.mark.parametrize(
    ("driver", "is_dear"),
    [
        *((robot(kind, ""), kind in ("serial", "mqtt", "rosbridge", "ssh")) for kind in KINDS),
        (robot("tcp", "", via="other"), True),
        (robot("tcp", "wait"), True),
        (robot("ssh", "abort"), False),
        (robot("tcp", "wait", "abort"), False),
        (robot("tcp", "", "wait"), True),
    ],
)
def test_line_that_is_dear_to_open_is_waited_for(driver: Driver, is_dear: bool) -> None:
    """Unless a control says otherwise; of two that differ, the more careful counts."""
    make = lines_of(reins(driver).client)[-1].make
    assert make.is_strict is is_dear
    assert make.stalled_s == (WAITED_S if is_dear else STALLED_S)


def test_guard_is_told_how_to_make_each_line() -> None:
    """As it is made here, in the order in which they carry each other."""
    other, line = lines_of(reins(robot("ssh", via="other")).client)
    assert other.make.line == "other"
    assert (other.make.via, line.make.via) == ("", "other")
    assert line.make.line == "wire"
    assert line.make.factory == f"{__name__}:Stub"
    assert (line.make.options, line.make.subscriptions) == ({}, [])
    assert isinstance(line.transport, Stub)
    assert line.transport.setup.name == "wire"
    assert line.transport.setup.via is other.transport


def test_guard_is_told_the_settings_and_what_is_listened_to() -> None:
    port = compile_template("{{ settings.port }}")
    read = ReadSpec("json", topic=compile_template("/odom"), listen={"type": "Odometry"})
    driver = Driver(
        {"wire": TransportSpec("wire", "rosbridge", options={"port": port})},
        messages={"odom": Message("odom", "wire", read)},
    )
    movers = take_reins(driver, {"port": 9090}, TABLE, FakeClock(), is_guarded=False)
    make = lines_of(movers.client)[0].make
    assert make.options == {"port": 9090}
    assert make.subscriptions == [("/odom", {"type": "Odometry"})]


def test_guard_in_this_process_goes_by_the_clock_of_the_session() -> None:
    clock = FakeClock()
    movers = take_reins(robot("tcp"), {}, TABLE, clock, is_guarded=False)
    assert movers.client._now() == clock.now()


def test_guard_is_a_process_where_the_system_can(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    driver = robot("tcp")
    assert isinstance(reins(driver).client, LocalGuard)
    guarded = reins(driver, is_guarded=True)
    assert isinstance(guarded.client, Guard)
    assert not guarded.is_open("away")
    assert not caplog.records
    monkeypatch.setattr(guarding, "CAN_GUARD", False)
    assert isinstance(reins(driver, is_guarded=True).client, LocalGuard)
    assert "there is no guard on this system" in caplog.text


@pytest.mark.parametrize("kind", KINDS)
def test_connection_is_reset_a_little_before_its_robot_counts_as_silent(kind: str) -> None:
    """A line without one keeps nothing that a reset could throw away."""
    specs = {
        "wire": TransportSpec("wire", kind, stale_after_s=2.0),
        "talker": TransportSpec("talker", kind),
    }
    line, talker = lines_of(reins(Driver(specs)).client)
    assert talker.make.silent_s is None
    if kind in ("udp", "serial"):
        assert line.make.silent_s is None
    else:
        assert line.make.silent_s == pytest.approx(1.8)
