"""The common part of `urc serve` and `urc demo`: from profiles to a running server."""

import asyncio
import gc
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from urc.cli.entrance import Entrance, access_for, announce
from urc.cli.failures import Misuse
from urc.cli.faults import Faulty
from urc.cli.output import complain
from urc.cli.own_data import own_folder
from urc.cli.running import run_loop
from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import UrcError
from urc.runtime.catalog import built_in_catalog
from urc.runtime.kept import Kept
from urc.runtime.selftest import sample_settings
from urc.runtime.session import Motion, Session
from urc.simulator.stand_in import stand_in
from urc.simulator.twin import Twin
from urc.web.app import Robot, build_app, serve
from urc.web.fleet.garage import Garage, Workshop
from urc.web.fleet.robots import Glimpse

__all__ = ["Place", "SettingsOf", "run_dashboard", "workshop_of"]

SettingsOf = Callable[[Profile], Mapping[str, Value]]
"""The settings of a profile that were given at the start; raises `UrcError` for those that no
longer fit."""
_LOOK = (320, 240)
"""Columns and rows of the picture on a card."""


def _nothing(_: Profile) -> Mapping[str, Value]:
    """Nothing was given."""
    return {}


@dataclass(frozen=True, slots=True)
class Place:
    """Where the dashboard is."""

    host: str
    port: int
    allowed_hosts: Sequence[str] = ()
    data: Path | None = None
    """Folder of URC's own data; None: that of this user."""
    has_guard: bool = True
    """Whether a guard process stops motion when this one cannot."""
    tiles: Path | None = None
    """Folder of map pictures; None: maps are grids."""
    token: str = ""
    """Of those who manage from other machines; "": none may."""
    shows_installed: bool = False
    """Whether the robots and drivers that are installed are on the menu."""
    trusted: Sequence[str] = ()
    """Widgets that do not ship with URC, and share the page all the same."""
    recordings: Path | None = None
    """Folder in which each session is kept; None: none is."""


def run_dashboard(
    profiles: Sequence[Profile],
    place: Place,
    *,
    is_simulated: bool,
    on_ready: Callable[[Entrance], None],
    given: SettingsOf = _nothing,
    is_dev: bool = False,
    faults: Sequence[str] = (),
) -> int:
    """Serve the dashboard until a signal ends it, which is fine: return 0.

    Args:
        profiles: the robots that are there from the start.
        place: address, port, the names it answers to, and what is kept where.
        is_simulated: each robot is emulated, over a real socket, instead of the real one.
        on_ready: called once with the way in.
        given: the settings of a profile that were given at the start.
        is_dev: whether there are dev pages, and documents are read again when they are saved.
        faults: what goes wrong with emulated robots, as ``loss=5%`` or ``tello:loss=5%``.

    Raises:
        UrcError: a port that cannot be had, two robots of one name, a fault that none can have.
    """
    names = [profile.name for profile in profiles]
    for name in names:
        if names.count(name) > 1:
            raise Misuse(f"two robots are named {name!r}; a name must be unique")
    faulty = Faulty() if is_simulated else None
    work = _serve(profiles, place, faulty, on_ready, given, is_dev, faults)
    return run_loop(work, code_when_ended=0, is_fast=True)


async def _serve(
    profiles: Sequence[Profile],
    place: Place,
    faulty: Faulty | None,
    on_ready: Callable[[Entrance], None],
    given: SettingsOf,
    is_dev: bool,
    faults: Sequence[str],
) -> int:
    async with AsyncExitStack() as stack:
        workshop = workshop_of(place, given, faulty)
        access = access_for(place.host, place.token)

        def ready(url: str) -> None:
            entrance = Entrance(url, access)
            announce(stack, workshop.data, place.host, entrance)
            on_ready(entrance)

        garage = Garage(workshop)
        robots: dict[str, Robot] = {}
        for profile in profiles:
            robot = _first(garage, profile)
            if faulty is not None:
                # Emulated from the start, whether somebody looks at it or not.
                twin = Twin(robot.profile, robot.settings)
                stack.enter_context(faulty.watch(profile.name, twin))
                redirected = await stack.enter_async_context(
                    stand_in(robot.profile, robot.settings, twin)
                )
                robot = _robot(place, None, redirected, robot.settings)
                robot = replace(robot, glimpse=partial(_seen, twin), is_emulated=True)
            robots[profile.name] = robot
        if faulty is not None:
            faulty.begin(faults)
            await stack.enter_async_context(_listening(faulty))
        remade = {name: partial(garage.robot, name) for name in robots} if is_dev else None
        app = build_app(
            robots,
            access=access,
            allowed_hosts=place.allowed_hosts,
            data=workshop.data,
            tiles=place.tiles,
            remake=remade,
            workshop=workshop,
            trusted=place.trusted,
        )
        gc.collect()
        gc.freeze()  # what is loaded by now stays: looking through it again would hold us up
        await serve(app, host=place.host, port=place.port, on_ready=ready)
    return 0


@asynccontextmanager
async def _listening(faulty: Faulty) -> AsyncIterator[None]:
    """Execute typed fault commands for as long as the context lasts."""
    task = asyncio.create_task(faulty.listen())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def workshop_of(
    place: Place, given: SettingsOf = _nothing, faulty: Faulty | None = None
) -> Workshop:
    """Return what makes the robots of a dashboard while it runs; `faulty`: they are emulated."""
    return Workshop(
        own_folder(place.data),
        make=partial(_robot, place, faulty),
        tried=partial(_session, "none", None, faulty),
        given=given,
        shows_installed=place.shows_installed,
    )


def _motion(place: Place) -> Motion:
    return "guarded" if place.has_guard else "here"


def _first(garage: Garage, profile: Profile) -> Robot:
    """Return a robot that exists from the start, with or without stored settings."""
    try:
        return garage.robot(profile.name, profile)
    except UrcError as error:
        complain(f"urc: {error}; what was filled in for {profile.name} is left out")
        return garage.robot(profile.name, profile, Kept())


def _robot(
    place: Place, faulty: Faulty | None, profile: Profile, values: Mapping[str, Value]
) -> Robot:
    """Return a robot whose session opens with its first page."""
    settings = values if faulty is None else _complete(profile, values)
    opened = partial(_session, _motion(place), place.recordings, faulty, profile, settings)
    return Robot(profile, settings, opened, is_emulated=faulty is not None)


def _seen(twin: Twin) -> Glimpse:
    """Return what an emulated robot looks like: through its camera, from above, or in figures."""
    now_s = time.time()
    return twin.camera(now_s) or twin.top_view(*_LOOK, now_s) or twin.readings(now_s)


@asynccontextmanager
async def _session(
    motion: Motion,
    recordings: Path | None,
    faulty: Faulty | None,
    profile: Profile,
    values: Mapping[str, Value],
) -> AsyncIterator[Session]:
    """Open a session with a robot, or with its twin, which lives as long as the session."""
    transports = built_in_catalog().transports
    async with AsyncExitStack() as stack:
        settings = values
        if faulty is not None:
            settings = _complete(profile, values)
            twin = Twin(profile, settings)
            stack.enter_context(faulty.watch(profile.name, twin))
            profile = await stack.enter_async_context(stand_in(profile, settings, twin))
        session = Session(profile, settings, transports, motion=motion)
        if recordings is not None:
            # First in, last out: what is said at both ends of the session is recorded, too.
            await stack.enter_async_context(_kept(session, recordings))
        yield await stack.enter_async_context(session)


@asynccontextmanager
async def _kept(session: Session, folder: Path) -> AsyncIterator[None]:
    """Record a session; where that cannot be, it is said, and the robot is driven all the same."""
    from urc.runtime.recording.recorder import recorded  # most record nothing

    profile = session.profile
    keeping = recorded(session.hub, folder, profile, is_folder=True)
    async with AsyncExitStack() as stack:
        recorder = await stack.enter_async_context(keeping)
        try:
            yield
        finally:
            await stack.aclose()
            if recorder.fault:
                complain(f"urc: {profile.name}: {recorder.fault}")


def _complete(profile: Profile, values: Mapping[str, Value]) -> dict[str, Value]:
    """Return settings with defaults for values that only a real robot needs."""
    return sample_settings(profile.settings) | dict(values)
