"""A page with any rights, that end and return at any time, does nothing beyond its rights.

A model predicts which commands and motions may reach the robot. The page sends valid, damaged and
random messages; its rights change between them, with and without a look of the socket.
"""

import asyncio
import json
from typing import Any, cast

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from tests.unit.web.test_client import FakeLine
from urc.model.driver import Argument, Command
from urc.model.exchange import Hold
from urc.model.payload import WriteSpec
from urc.model.role import ROLES, Role, includes
from urc.runtime.audit_recorder import AuditRecorder
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.movers import FakeMotionBackend
from urc.web.feed.client_socket import SocketPeer
from urc.web.fleet.robots import Robot, RobotService
from urc.web.page_socket import BrowserClient

NEEDS: dict[str, Role] = {"drive": "drive", "lights": "drive", "calibrate": "maintain"}
SPEED = {"speed": Argument("speed", "number", min=-1, max=1)}
COMMANDS = {
    "drive": Command(
        "drive", "wire", WriteSpec("text", {}), SPEED, hold=Hold(0.05, {"speed": 0.0}, 0.25)
    ),
    "lights": Command("lights", "wire", WriteSpec("text", {})),
    "calibrate": Command("calibrate", "wire", WriteSpec("text", {}), role="maintain"),
}

_name = st.sampled_from([*NEEDS, "nothing", ""])
_number = st.integers(-1, 50) | st.integers(-(2**70), 2**70)
_verb = st.sampled_from(["take", "ask", "yes", "no", "force", "leave", "reset", "own"])
_scalar = st.none() | st.booleans() | st.floats(-2, 2) | st.text(max_size=5)
_values = st.dictionaries(st.sampled_from(["speed", "x"]), _scalar, max_size=2)
_run = st.fixed_dictionaries({"t": st.just("run"), "id": _number, "command": _name})
_message = st.one_of(
    st.fixed_dictionaries(
        {"t": st.just("run"), "id": _number, "command": _name, "arguments": _values}
    ),
    st.fixed_dictionaries({"t": st.just("drive"), "verb": _verb}),
    st.fixed_dictionaries({"t": st.just("tick"), "command": _name, "arguments": _values}),
    st.fixed_dictionaries({"t": st.just("release"), "command": _name, "number": _number}),
    st.fixed_dictionaries({"t": st.just("stop")}),
    st.fixed_dictionaries({"t": st.just("agree"), "n": _number, "yes": st.booleans()}),
    st.fixed_dictionaries({"t": st.just("prepare"), "id": _number, "command": _name}),
    st.fixed_dictionaries({"t": st.just("steer"), "command": _name, "verb": st.just("pause")}),
    st.fixed_dictionaries({"t": st.just("show"), "signals": st.lists(_name, max_size=3)}),
    st.fixed_dictionaries({"t": st.just("ping"), "c": _number}),
)
_role = st.none() | st.sampled_from(ROLES)
_scope = st.sampled_from([(), ("lights",), ("drive", "calibrate")])
_rights = st.tuples(st.just("rights"), _role, _scope, st.booleans())
_step = st.one_of(
    st.tuples(st.just("say"), _message),
    st.tuples(st.just("say"), _run),
    st.tuples(st.just("say"), st.text(max_size=20)),
    st.just(("drives",)),
    st.just(("drives",)),
    _rights,
    st.tuples(st.just("waits"), st.sampled_from([0.01, 0.05, 0.3, 1.0])),
)


class _Rights:
    def __init__(self, role: Role | None, scope: tuple[str, ...]) -> None:
        self.now, self.scope = role, scope

    def role(self) -> Role | None:
        """Return the present role."""
        return self.now

    def may_give(self, command: str) -> bool:
        """Return whether the scope contains a command."""
        return not self.scope or command in self.scope

    def limit(self) -> str:
        """Return "" for no limit."""
        return ""

    def permit(self, command: str) -> bool:
        """Return whether a command may reach the robot now, as the model says."""
        return includes(self.now, NEEDS.get(command, "drive")) and self.may_give(command)


class _World:
    """One page at one robot."""

    def __init__(self, rights: _Rights) -> None:
        self.rights, self.clock, self.line = rights, FakeClock(), FakeLine()
        self.robot = FakeRobot(dashboard_profile(commands=COMMANDS), self.clock)
        recorder = AuditRecorder("puppet", lambda _: None, utc=lambda: 99.0)
        self.service = RobotService(
            Robot(self.robot.profile, {}, self.robot.open), clock=self.clock, recorder=recorder
        )
        peer = SocketPeer(rights=rights)
        self.client = BrowserClient(self.line, self.service, self.line, peer)
        self.number = 0
        self.is_told = True
        """Whether the page's socket has heard of the last change of rights."""

    @property
    def motions(self) -> list[str]:
        """Frames that moved the robot."""
        backend = cast("FakeMotionBackend", self.robot.backend)
        return [text for text in backend.texts if not text.endswith("stop")]

    def drive(self) -> None:
        """Take the lease and send a tick, as a page does."""
        leases, beats = self.line.of_type("lease"), self.line.of_type("beat")
        holder = leases[-1].get("holder") if leases else None
        if not holder or holder["id"] != leases[-1]["you"]:
            self.line.say({"t": "drive", "verb": "take"})
        elif beats:
            self.number += 1
            tick = {"t": "tick", "command": "drive", "arguments": {"speed": 0.5}}
            tick |= {"epoch": leases[-1]["epoch"], "number": self.number, "echo": beats[-1]["n"]}
            self.line.say(tick)

    async def take(self, step: tuple[Any, ...]) -> None:
        """Carry out a step, and compare its effects with the model."""
        given, moved = len(self.robot.commands), len(self.motions)
        was_latched = bool(self.service.controls.controller.lease.latched)
        if step[0] == "rights":
            self.rights.now, self.rights.scope = step[1], step[2]
            self.is_told = step[3]
            if step[3]:
                self.client.recheck()
        elif step[0] == "waits":
            await self.clock.advance(step[1])
        elif step[0] == "drives":
            self.drive()
        else:
            self.line.say(step[1] if isinstance(step[1], str) else json.dumps(step[1]))
        await settle()
        for command, _ in self.robot.commands[given:]:
            assert self.rights.permit(command), (step, command)
        # Until the socket hears of a change, the engine repeats the last tick within its lease.
        repeats = step[0] == "waits" and not self.is_told
        assert len(self.motions) == moved or self.rights.permit("drive") or repeats, step
        lease = self.service.controls.controller.lease
        if was_latched and not lease.latched:
            assert includes(self.rights.now, "drive"), step
        if step[0] == "rights" and step[3] and not includes(self.rights.now, "drive"):
            assert lease.state.holder is None


async def _play(rights: _Rights, steps: list[tuple[Any, ...]]) -> _World:
    world = _World(rights)
    running = asyncio.create_task(world.service.run())
    serving = asyncio.create_task(world.client.serve())
    await settle()
    for step in steps:
        await world.take(step)
    world.line.leave()
    await settle()
    assert serving.done()
    assert not serving.cancelled()
    assert serving.exception() is None
    running.cancel()
    return world


@given(_role, _scope, st.lists(_step, max_size=25))
@settings(max_examples=examples(2400), deadline=None)
def test_no_message_acts_beyond_the_rights_of_its_page(
    role: Role | None, scope: tuple[str, ...], steps: list[tuple[Any, ...]]
) -> None:
    asyncio.run(_play(_Rights(role, scope), steps))


def test_the_model_sees_motion_and_commands() -> None:
    """Otherwise it would prove nothing."""
    steps = [("drives",), ("waits", 0.05), ("drives",), ("waits", 0.05), ("drives",)]
    steps.append(("say", {"t": "run", "id": 1, "command": "lights"}))
    world = asyncio.run(_play(_Rights("drive", ()), steps))
    assert world.motions
    assert world.robot.commands == [("lights", {})]
