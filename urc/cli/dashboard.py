"""What `urc serve` and `urc demo` share: profiles → robots of the dashboard → a running server."""

from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from urc._folders import data_folder
from urc.cli.failures import Misuse
from urc.cli.running import run_loop
from urc.model.profile import Profile
from urc.model.values import Value
from urc.runtime.catalog import built_in_catalog
from urc.runtime.selftest import sample_settings
from urc.runtime.session import Motion, Session
from urc.simulator.stand_in import stand_in
from urc.web.app import Robot, build_app, serve

__all__ = ["Place", "SettingsOf", "run_dashboard"]

SettingsOf = Callable[[Profile], Mapping[str, Value]]
"""The settings of a profile that are known; raises `UrcError` for those that no longer fit."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where the dashboard is."""

    host: str
    port: int
    allowed_hosts: Sequence[str] = ()
    data: Path | None = None
    """Folder of URC's own data; None: that of this user."""
    has_guard: bool = True
    """Whether a process of its own stops what moves when this one cannot."""
    tiles: Path | None = None
    """Folder of map pictures; None: maps are grids."""


def run_dashboard(
    profiles: Sequence[tuple[Profile, Mapping[str, Value]]],
    place: Place,
    *,
    is_simulated: bool,
    on_ready: Callable[[str], None],
    settings_of: SettingsOf | None = None,
) -> int:
    """Serve the dashboard until a signal ends it, which is fine: return 0.

    Args:
        profiles: each with the settings that are known.
        place: address, port and the names it answers to.
        is_simulated: each robot is emulated, over a real socket, instead of the real one.
        on_ready: called once with the address.
        settings_of: the settings of a profile that was saved anew, for the dev pages; None: there
            are none.

    Raises:
        UrcError: a port that cannot be had, two robots of one name.
    """
    names = [profile.name for profile, _ in profiles]
    for name in names:
        if names.count(name) > 1:
            raise Misuse(f"two robots are named {name!r}; a name must be unique")
    work = _serve(profiles, place, is_simulated, on_ready, settings_of)
    return run_loop(work, code_when_ended=0, is_fast=True)


async def _serve(
    profiles: Sequence[tuple[Profile, Mapping[str, Value]]],
    place: Place,
    is_simulated: bool,
    on_ready: Callable[[str], None],
    settings_of: SettingsOf | None,
) -> int:
    async with AsyncExitStack() as stack:
        transports = built_in_catalog().transports
        motion: Motion = "guarded" if place.has_guard else "here"
        robots: dict[str, Robot] = {}
        for original, known in profiles:
            profile, settings = original, known
            if is_simulated:
                # What only a real robot needs to be told, nobody must fill in for its twin.
                settings = sample_settings(profile.settings) | dict(known)
                profile = await stack.enter_async_context(stand_in(profile, settings))
            session = partial(Session, profile, settings, transports, motion=motion)
            robots[profile.name] = Robot(profile, settings, session)
        data = place.data or data_folder()
        remake = settings_of and dict.fromkeys(robots, _remaker(settings_of, is_simulated, motion))
        app = build_app(
            robots, allowed_hosts=place.allowed_hosts, data=data, tiles=place.tiles, remake=remake
        )
        await serve(app, host=place.host, port=place.port, on_ready=on_ready)
    return 0


def _remaker(
    settings_of: SettingsOf, is_simulated: bool, motion: Motion
) -> Callable[[Profile], Robot]:
    """Return what makes the robot of a profile that was saved anew."""
    transports = built_in_catalog().transports

    def remake(profile: Profile) -> Robot:
        known = settings_of(profile)
        if not is_simulated:
            session = partial(Session, profile, known, transports, motion=motion)
            return Robot(profile, known, session)
        settings = sample_settings(profile.settings) | dict(known)
        return Robot(profile, settings, partial(_with_twin, profile, settings))

    @asynccontextmanager
    async def _with_twin(profile: Profile, settings: Mapping[str, Value]) -> AsyncIterator[Session]:
        async with (
            stand_in(profile, settings) as redirected,
            Session(redirected, settings, transports, motion=motion) as session,
        ):
            yield session

    return remake
