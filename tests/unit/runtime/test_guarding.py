"""What the guard is told of a driver: how to make each line, and the terms of held commands."""

import pytest

from tests.unit.runtime.desks import DRIVER, held
from urc.expressions import compile_template
from urc.guard.guard_client import GuardClient, HeldSpec
from urc.guard.local_channel import LocalChannel
from urc.guard.pipe_channel import PipeChannel
from urc.model.driver import Driver, Message, TransportSpec
from urc.model.payload import ReadSpec
from urc.motion.hold_to_run import LATE_STOP_S, LEASE_S, STOP_FOR_S, HoldTerms
from urc.motion.stall import STALLED_S, WAITED_S
from urc.registry import Table
from urc.runtime import guarding
from urc.runtime.guarding import start_guard_client
from urc.runtime.held_commands import restored_s
from urc.testing.clock import FakeClock
from urc.transports.base import TransportSetup

HELD = {
    "drive": HeldSpec("wire", HoldTerms(b"", 0.05, LEASE_S, is_lossy=False)),
    "lift": HeldSpec("air", HoldTerms(b"", 0.05, LEASE_S, is_lossy=True)),
}


class Stub:
    """A transport that is never opened."""

    def __init__(self, setup: TransportSetup) -> None:
        self.setup = setup
        self.address = f"stub {setup.name}"


KINDS = ("tcp", "udp", "serial", "mqtt", "zenoh", "ros", "ssh")
TABLE = Table("urc.transports", dict.fromkeys(KINDS, f"{__name__}:Stub"))


def scheduler(driver: Driver, *, is_guarded: bool = False) -> GuardClient:
    return start_guard_client(driver, {}, TABLE, FakeClock(), is_guarded=is_guarded)


def robot(kind: str, *on_stall: str, tunnel: str = "") -> Driver:
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
        "wire": TransportSpec("wire", kind, tunnel=tunnel),
    }
    return Driver(specs, commands=commands)


@pytest.mark.parametrize(
    ("kind", "options", "lasts_s"),
    [
        ("udp", {}, STOP_FOR_S),
        ("mqtt", {}, STOP_FOR_S),
        ("ros", {}, STOP_FOR_S),
        ("ros", {"via": "foxglove"}, STOP_FOR_S),
        ("ros", {"via": "zenoh"}, LATE_STOP_S),
        ("ros", {"via": compile_template("{{ settings.bridge }}")}, LATE_STOP_S),
        ("zenoh", {}, LATE_STOP_S),
    ],
)
def test_stop_is_repeated_longer_where_the_robot_may_come_back_later_than_urc(
    kind: str, options: dict[str, object], lasts_s: float
) -> None:
    driver = Driver({"wire": TransportSpec("wire", kind, options)})
    assert restored_s(driver, "wire") == lasts_s


def test_guard_is_told_the_terms_of_each_held_command() -> None:
    """For a stop before anything is armed."""
    assert scheduler(DRIVER)._held == HELD


@pytest.mark.parametrize(
    ("driver", "is_dear"),
    [
        *((robot(kind, ""), kind in ("serial", "mqtt", "zenoh", "ros", "ssh")) for kind in KINDS),
        (robot("tcp", "", tunnel="other"), True),
        (robot("tcp", "wait"), True),
        (robot("ssh", "abort"), False),
        (robot("tcp", "wait", "abort"), False),
        (robot("tcp", "", "wait"), True),
    ],
)
def test_line_that_is_dear_to_open_is_waited_for(driver: Driver, is_dear: bool) -> None:
    """Unless a control says otherwise; of two that differ, the more careful counts."""
    make = scheduler(driver).lines[-1].make
    assert make.is_strict is is_dear
    assert make.stalled_s == (WAITED_S if is_dear else STALLED_S)


def test_guard_is_told_how_to_make_each_line() -> None:
    """As it is made here, in the order in which they carry each other."""
    other, line = scheduler(robot("ssh", tunnel="other")).lines
    assert other.make.line == "other"
    assert (other.make.tunnel, line.make.tunnel) == ("", "other")
    assert line.make.line == "wire"
    assert line.make.factory == f"{__name__}:Stub"
    assert (line.make.options, line.make.subscriptions) == ({}, [])
    assert isinstance(line.transport, Stub)
    assert line.transport.setup.name == "wire"
    assert line.transport.setup.tunnel is other.transport


def test_guard_is_told_the_settings_and_what_is_listened_to() -> None:
    port = compile_template("{{ settings.port }}")
    read = ReadSpec("json", topic=compile_template("/odom"), listen={"type": "Odometry"})
    driver = Driver(
        {"wire": TransportSpec("wire", "ros", options={"port": port})},
        messages={"odom": Message("odom", "wire", read)},
    )
    backend = start_guard_client(driver, {"port": 9090}, TABLE, FakeClock(), is_guarded=False)
    make = backend.lines[0].make
    assert make.options == {"port": 9090}
    assert make.subscriptions == [("/odom", {"type": "Odometry"})]


def test_guard_in_this_process_goes_by_the_clock_of_the_session() -> None:
    clock = FakeClock()
    backend = start_guard_client(robot("tcp"), {}, TABLE, clock, is_guarded=False)
    assert backend.channel.now() == clock.now()


def test_guard_is_a_process_where_the_system_can(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    driver = robot("tcp")
    assert isinstance(scheduler(driver).channel, LocalChannel)
    guarded = scheduler(driver, is_guarded=True)
    assert isinstance(guarded.channel, PipeChannel)
    assert not guarded.is_open("away")
    assert not caplog.records
    monkeypatch.setattr(guarding, "CAN_GUARD", False)
    assert isinstance(scheduler(driver, is_guarded=True).channel, LocalChannel)
    assert "this system cannot run a guard process" in caplog.text


@pytest.mark.parametrize("kind", KINDS)
def test_connection_is_reset_a_little_before_its_robot_counts_as_silent(kind: str) -> None:
    """A line without one keeps nothing that a reset could throw away."""
    specs = {
        "wire": TransportSpec("wire", kind, stale_after_s=2.0),
        "talker": TransportSpec("talker", kind),
    }
    line, talker = scheduler(Driver(specs)).lines
    assert talker.make.silent_s is None
    if kind in ("udp", "serial"):
        assert line.make.silent_s is None
    else:
        assert line.make.silent_s == pytest.approx(1.8)
