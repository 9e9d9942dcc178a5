"""The controls as screens see them: seats, beats, thinned ticks, and what each is told."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Collection
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.unit.runtime.desks import DRIVER
from urc.access.directory import Identity
from urc.guard.goal_reports import GoalReports
from urc.model.driver import Driver
from urc.model.role import Role
from urc.protocol.events import MotionEvent, MotionRefused
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_recorder import AuditRecorder
from urc.runtime.hub import Hub
from urc.runtime.latch import LatchStore
from urc.testing.clock import FakeClock, settle
from urc.testing.movers import FakeFrames, FakeMotionBackend
from urc.web.drive.control_service import BEAT_S, THINNED_S, ControlService, OperatorSession
from urc.web.feed.client_socket import FixedRights, SocketPeer
from urc.web.wire import drive as wire

pytestmark = pytest.mark.anyio


class Scene:
    """Controls with a robot that is connected."""

    def __init__(self, file: LatchStore | None = None, driver: Driver = DRIVER) -> None:
        self.clock = FakeClock()
        self.audit: list[AuditEntry] = []
        recorder = AuditRecorder("rover", self.audit.append, utc=lambda: 99.0)
        self.controls = ControlService(driver, self.clock, file, recorder)
        self.frames = FakeFrames(driver)
        self.backend = FakeMotionBackend(self.clock)
        self.on_motion: Callable[[MotionEvent], None] | None = None
        self.hub = Hub({})
        self.goals = GoalReports(())
        self.told: dict[str, list[dict[str, Any]]] = {}
        self.beats: dict[str, int] = {}
        self._numbers = 0

    def latch(self, reason: str) -> None:
        """Take why nothing may be begun that moves by itself."""

    def end_cancellations(self, actions: Collection[str]) -> None:
        """Take the actions whose cancellations end."""

    def add_page(self, place: str = "", role: Role = "drive") -> OperatorSession:
        """Sit down, and read what is told at once."""
        peer = SocketPeer(place, rights=FixedRights(role))
        operator = self.controls.add_page(peer, lambda: None)
        self.told[operator.client.id] = []
        self.read(operator)
        return operator

    def read(self, operator: OperatorSession) -> list[dict[str, Any]]:
        """Return what a screen is told now, beats apart."""
        messages = [json.loads(text) for text in self.controls.changes(operator)]
        for message in messages:
            if message["t"] == "beat":
                self.beats[operator.client.id] = message["n"]
        return [message for message in messages if message["t"] != "beat"]

    def say(self, operator: OperatorSession, verb: wire.Verb) -> None:
        """Want something of the controls."""
        self.controls.handle(operator, wire.Drive(verb))
        self.read(operator)

    def tick(
        self,
        operator: OperatorSession,
        speed: Any = 0.5,
        command: str = "drive",
        sees: tuple[int, int] | None = None,
    ) -> None:
        """Tick as a page does."""
        self.read(operator)
        self._numbers += 1
        epoch, echo = (
            self.controls.controller.lease.state.epoch,
            self.beats.get(operator.client.id, 0),
        )
        said = wire.Tick(command, epoch, self._numbers, echo, {"speed": speed}, sees)
        self.controls.handle(operator, said)


@asynccontextmanager
async def scene(file: LatchStore | None = None, driver: Driver = DRIVER) -> AsyncIterator[Scene]:
    """Attach the robot; it is gone after the test."""
    it = Scene(file, driver)
    task = asyncio.create_task(it.controls.serve(it))  # type: ignore[arg-type]  # it has all
    await settle()
    yield it
    task.cancel()
    await settle()


async def test_everybody_is_told_of_every_change_and_only_the_holder_hears_beats() -> None:
    """The newest lease only, however many there were since it was read."""
    async with scene() as it:
        ann, bob = it.add_page(), it.add_page("192.168.1.7")
        it.say(ann, "take")
        (lease,) = it.read(bob)
        assert lease["holder"] == {"id": "s1", "name": "screen 1"}
        assert (lease["you"], lease["name"]) == ("s2", "screen 2 at 192.168.1.7")
        first = it.beats["s1"]
        for _ in range(4):
            await it.clock.advance(BEAT_S)
            assert it.read(ann) == []
        assert it.beats == {"s1": first + 4}
        it.say(ann, "leave")
        it.say(ann, "take")
        it.say(ann, "leave")
        assert [message["t"] for message in it.read(bob)] == ["lease"]
        await it.clock.advance(1)
        assert it.beats == {"s1": it.beats["s1"]}


async def test_a_flood_is_thinned_and_its_last_value_arrives() -> None:
    """A thousand ticks a second: at most the thinned rate is looked at, the newest of them."""
    async with scene() as it:
        ann = it.add_page()
        it.say(ann, "take")
        looked: list[float] = []
        tick: Callable[..., str] = it.controls.controller.tick

        def counted(*words: Any) -> str:
            looked.append(words[2]["speed"])
            return tick(*words)

        it.controls.controller.tick = counted  # type: ignore[method-assign]
        for step in range(1000):
            it.tick(ann, step / 1000)
            await it.clock.advance(0.001)
        await it.clock.advance(0.1)
        assert len(looked) <= 1.0 / THINNED_S + 2
        assert looked[-1] == 0.999
        assert it.backend.texts[-1] == "drive speed=0.999"
        assert len(it.backend.texts) <= 1.1 / 0.05 + 2, "the declared rate, on the wire"


async def test_a_flood_is_neither_read_nor_received_until_its_turn() -> None:
    """Its line is held back for some milliseconds, and then brings the newest."""
    async with scene() as it:
        ann = it.add_page()
        it.say(ann, "take")
        held: list[bool] = []
        ann.hold_back = held.append

        def offered(number: int, speed: float) -> str:
            it.read(ann)
            epoch, echo = it.controls.controller.lease.state.epoch, it.beats["s1"]
            tick = (
                f'"epoch":{epoch},"number":{number},"echo":{echo},"arguments":{{"speed":{speed}}}'
            )
            return it.controls.offer(ann, f'{{"t":"tick","command":"drive",{tick}}}'.encode())

        assert offered(1, 0.1) == "one more", "the first is looked at in full"
        await it.clock.advance(0.05)
        assert [offered(2, 0.2), offered(3, 0.3)] == ["in time"] * 2, "two at once are in time"
        assert [offered(number, 0.01 * number) for number in range(4, 8)] == ["one more"] * 4
        assert held == []
        assert it.controls.offer(ann, b'{"t":"tick","command":"drive", nonsense') == "one more"
        assert held == [True], "five that wait for one turn are a flood"
        assert offered(9, 0.9) == "one more"
        assert ann.dropped == 5
        await it.clock.advance(THINNED_S)
        assert held == [True, False]
        await it.clock.advance(0.05)
        assert it.backend.texts[-1] == "drive speed=0.9"


async def test_a_tick_that_waits_unread_and_is_none_is_told() -> None:
    """It took the place of a good one, and moves nothing."""
    async with scene() as it:
        ann = it.add_page()
        it.say(ann, "take")
        for speed in (0.1, 0.2, 0.3):
            it.tick(ann, speed)
        assert it.controls.offer(ann, b'{"t":"tick","command":"drive","number":7}') == "one more"
        await it.clock.advance(THINNED_S)
        (told,) = it.read(ann)
        assert told["about"] == "tick"
        assert "epoch" in told["message"]
        assert not ann.pending


async def test_what_waits_is_forgotten_by_a_release_a_stop_and_a_page_that_goes() -> None:
    """A thinned tick that comes after the hand has gone would move the robot again."""
    async with scene() as it:
        for end in ("release", "stop", "rise"):
            ann = it.add_page()
            it.say(ann, "reset")
            it.say(ann, "take")
            it.tick(ann, 0.1)
            it.tick(ann, 0.2)
            it.tick(ann, 0.3)
            if end == "release":
                it.controls.handle(ann, wire.Release("drive"))
            elif end == "stop":
                it.controls.handle(ann, wire.Stop())
            else:
                it.controls.remove_page(ann)
            count = len(it.backend.texts)
            await it.clock.advance(1)
            assert [text for text in it.backend.texts[count:] if "stop" not in text] == []
            it.controls.remove_page(ann)


async def test_a_tick_from_before_the_release_moves_nothing_after_it() -> None:
    """Two threads of a program may swap them; the numbers tell their order."""
    async with scene() as it:
        ann = it.add_page()
        it.say(ann, "take")
        it.tick(ann, 0.1)
        await it.clock.advance(0.1)
        it.controls.handle(ann, wire.Release("drive", number=3))
        it.tick(ann, 0.2)  # its number is 2
        await it.clock.advance(0.1)
        assert it.backend.texts == ["drive speed=0.1", "drive stop"]
        it.tick(ann, 0.3)  # nor 3, the number of the release
        it.tick(ann, 0.4)
        await it.clock.advance(0.1)
        assert it.backend.texts[2:] == ["drive speed=0.4"]


async def test_a_stop_that_nobody_made_is_told_once_to_all() -> None:
    """The lease ran out: the holder's page must let go, and the others may know."""
    async with scene() as it:
        ann, bob = it.add_page(), it.add_page()
        it.say(ann, "take")
        it.tick(ann)
        await it.clock.advance(0.35)
        told = {"t": "stopped", "command": "drive", "reason": "expired"}
        assert told in it.read(ann)
        assert told in it.read(bob)
        assert it.backend.texts[-1] == "drive stop"


async def test_a_refused_tick_is_told_unless_the_control_moves_all_the_same() -> None:
    """One that came late among good ones is no news."""
    async with scene() as it:
        ann = it.add_page()
        it.say(ann, "take")
        it.tick(ann)
        await it.clock.advance(0.02)
        epoch = it.controls.controller.lease.state.epoch
        old = wire.Tick("drive", epoch, 0, it.beats["s1"])
        it.controls.handle(ann, old)
        assert [message for message in it.read(ann) if message["t"] == "refused"] == []
        await it.clock.advance(1)
        it.controls.handle(ann, old)
        (told,) = [message for message in it.read(ann) if message["t"] == "refused"]
        assert told["message"] == "the input is not newer than the previous input"
        it.controls.handle(ann, wire.Tick("beep", epoch, 9, 9))
        (told,) = it.read(ann)
        assert told["message"] == "'beep' is not a held command of this robot"


async def test_a_hostile_page_makes_nothing_grow() -> None:
    """Any number of names, wishes and ticks: what waits for a screen stays small."""
    async with scene() as it:
        ann = it.add_page()
        for step in range(5000):
            it.controls.handle(ann, wire.Tick(f"drive{step}", 1, step, 1))
            it.controls.handle(ann, wire.Drive("ask"))
            it.controls.handle(ann, wire.Drive("yes"))
            it.controls.handle(ann, wire.Release(f"drive{step}"))
        assert len(ann.notices) <= 8
        assert len(ann.pending) + len(ann.paces) + len(ann.alarms) <= 6


async def test_a_silent_holder_loses_the_controls_and_a_request_is_granted() -> None:
    """By time alone; the desk is asked at the right moment."""
    async with scene() as it:
        ann, bob = it.add_page(), it.add_page()
        it.say(ann, "take")
        it.controls.handle(bob, wire.Drive("ask", 3))
        await it.clock.advance(3.1)
        assert it.controls.controller.lease.state.holder == bob.client
        await it.clock.advance(61)
        assert it.controls.controller.lease.state.holder is None


def audited(it: Scene) -> list[str]:
    """Return what was noted: what, who, command, outcome."""
    return [" ".join(f"{e.what} {e.who} {e.command} {e.outcome}".split()) for e in it.audit]


async def test_the_audit_says_who_moved_what_and_why_it_stopped() -> None:
    """The frame, the arguments and the lease are in it; a release is a reason."""
    async with scene() as it:
        ann = it.add_page(role="maintain")
        it.say(ann, "take")
        it.tick(ann, 0.5)
        await it.clock.advance(0.05)
        it.tick(ann, 0.25)
        it.controls.handle(ann, wire.Release("drive"))
        await settle()
        assert audited(it) == [
            "lease screen 1 has the controls",
            "moved screen 1 drive begins",
            "stopped screen 1 drive released",
        ]
        moved, stopped = it.audit[1:]
        assert (moved.robot, moved.role, moved.client) == ("rover", "maintain", "s1")
        assert moved.epoch == it.controls.controller.lease.state.epoch
        assert moved.arguments == '{"speed": 0.5}'
        assert bytes.fromhex(moved.data) == b"drive speed=0.5"
        assert bytes.fromhex(stopped.data) == b"drive speed=0.25"
        assert (stopped.times, stopped.lasted_s) == (2, 0.05)


async def test_the_audit_names_whoever_was_refused_and_why() -> None:
    """A tick without the controls, a wish that is not granted, and what is no control."""
    async with scene() as it:
        ann, bob = it.add_page(), it.add_page("192.168.1.7")
        it.say(ann, "take")
        it.tick(bob)
        it.say(bob, "force")
        it.controls.handle(bob, wire.Tick("beep", 0, 1, 0, {}))
        it.controls.stop("vic")
        refused = [one for one in audited(it) if one.startswith("refused")]
        assert refused[0] == "refused screen 2 at 192.168.1.7 drive screen 1 has the controls"
        assert refused[1].startswith("refused screen 2 at 192.168.1.7 force ")
        assert refused[2].endswith("'beep' is not a held command of this robot")
        assert "STOP by vic" in audited(it)


async def test_the_audit_ends_a_motion_whose_robot_was_disconnected() -> None:
    """Nobody reports its stop any more."""
    async with scene() as it:
        ann = it.add_page()
        it.say(ann, "take")
        it.tick(ann)
    assert audited(it)[-1] == "stopped screen 1 drive the robot was disconnected"


async def test_an_audit_that_breaks_keeps_nobody_from_driving_and_stopping() -> None:
    """Whatever is wrong with it."""
    async with scene() as it:

        def broken(entry: AuditEntry) -> None:
            raise OSError("the disk is on fire")

        it.controls.recorder._note = broken
        ann = it.add_page()
        it.say(ann, "take")
        it.tick(ann, 0.5)
        assert it.backend.texts[-1] == "drive speed=0.5"
        it.controls.stop("ann")
        assert it.backend.texts[-1].endswith("stop")
        assert it.controls.controller.lease.state.latched_by == "ann"


async def test_a_latch_that_cannot_be_written_is_told_and_stops_all_the_same(
    tmp_path: Path,
) -> None:
    """In the log of the page, and to everybody at a screen, once; and when all is well again."""
    file = LatchStore(tmp_path / "latches", "rover")
    async with scene(file) as it:
        (tmp_path / "latches").write_text("a file where the folder should be")
        ann, bob = it.add_page(), it.add_page()
        it.say(ann, "take")
        it.tick(ann)
        await file.settle()
        it.controls.stop("bob")
        await file.settle()
        await settle()
        assert it.backend.texts[-2:] == ["drive stop", "lift stop"]
        assert it.controls.controller.is_confirmed
        (note,) = it.hub.notes
        assert (note.level, note.source) == ("error", "URC")
        assert note.text.startswith("STOP works, but would not survive a restart")
        told = [one for one in it.read(bob) if one["t"] == "refused"]
        assert [one["message"] for one in told] == [note.text]
        (tmp_path / "latches").unlink()
        it.say(bob, "reset")
        await file.settle()
        assert it.hub.notes[-1].text == "STOP is stored again and survives a restart of the server"


async def test_a_stop_that_is_owed_stays_so_with_another_driver_and_after_a_restart(
    tmp_path: Path,
) -> None:
    """It was pressed while the robot was away: whoever connects it next lets it hear of it."""
    file = LatchStore(tmp_path, "rover")
    controls = Scene(file).controls
    controls.stop("ann")
    controls.renew(DRIVER, file)
    await file.settle()
    assert not controls.controller.is_confirmed
    async with scene(LatchStore(tmp_path, "rover")) as it:
        assert it.backend.texts == ["drive stop", "lift stop"]
        assert it.controls.controller.is_confirmed
    await file.settle()


async def test_a_flood_costs_no_more_than_its_thinned_rate() -> None:
    """What is too much is counted and dropped before anything is made of it."""
    async with scene() as it:
        ann = it.add_page()
        it.say(ann, "take")
        made = 0
        frame = it.frames.motion_frame

        def counted(*words: Any) -> Any:
            nonlocal made
            made += 1
            return frame(*words)

        it.frames.motion_frame = counted  # type: ignore[method-assign]
        for step in range(2000):
            it.tick(ann, step / 2000)
            await it.clock.advance(0.0005)
        assert made <= 1.0 / THINNED_S + 2
        assert made + ann.dropped + len(ann.pending) == 2000


async def test_the_words_of_a_robot_that_refuses_to_move_are_told_at_its_control() -> None:
    """At once, to every screen; the audit has them, too."""
    async with scene() as it:
        ann, bob = it.add_page(), it.add_page()
        it.say(ann, "take")
        it.tick(ann)
        it.read(bob)
        it.controls.controller.handle(MotionRefused("wire", "drive", "the guard is open"))
        for operator in (ann, bob):
            (told,) = [one for one in it.read(operator) if one["t"] == "refused"]
            assert (told["command"], told["message"]) == ("drive", "the guard is open")
        assert it.backend.texts[-1] == "drive stop"
        assert [one.outcome for one in it.audit if one.what == "stopped"] == ["the guard is open"]


async def test_audit_names_person_right_and_place_of_each_event() -> None:
    it = Scene()
    ann = Identity("p1", "k1", "Ann", "person", "passkey", "p1")
    peer = SocketPeer("192.0.2.7", "p1", True, ann, rights=FixedRights("drive"))
    page = it.controls.add_page(peer, lambda: None)
    it.controls.handle(page, wire.Drive("take"))
    it.controls.handle(page, wire.Stop())
    it.controls.handle(page, wire.Drive("reset"))
    it.controls.stop("URC: a blocked package")
    told = [(one.what, one.who, one.principal, one.kind, one.way, one.place) for one in it.audit]
    named = ("Ann", "p1", "person", "passkey", "192.0.2.7")
    assert told == [
        ("lease", *named),
        ("STOP", *named),
        ("lease", *named),
        ("reset", *named),
        ("STOP", "", "", "", "", ""),
    ]


async def test_a_named_screen_drives_under_its_name_and_no_two_have_the_same() -> None:
    async with scene() as it:
        ann, bob = it.add_page(), it.add_page("192.168.1.7")
        it.controls.name_screen(ann, "Tablet in the lab")
        (lease,) = it.read(ann)
        assert lease["name"] == "Tablet in the lab"
        it.say(ann, "take")
        (lease,) = it.read(bob)
        assert lease["holder"] == {"id": "s1", "name": "Tablet in the lab"}
        it.controls.name_screen(bob, "Tablet in the lab")
        assert bob.client.name == "Tablet in the lab (screen 2 at 192.168.1.7)"


async def test_a_person_keeps_the_name_of_the_sign_in() -> None:
    async with scene() as it:
        who = Identity("p1", "s", "Ann", "person", "passkey", "p1")
        peer = SocketPeer("", identity=who, is_known=True, rights=FixedRights("drive"))
        operator = it.controls.add_page(peer, lambda: None)
        it.controls.name_screen(operator, "Bob")
        assert operator.client.name == "Ann"
