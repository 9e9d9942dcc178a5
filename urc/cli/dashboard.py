"""What `urc serve` and `urc demo` share: profiles → robots of the dashboard → a running server."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AsyncExitStack
from dataclasses import dataclass
from functools import partial

from urc.cli.failures import Misuse
from urc.cli.running import run_loop
from urc.model.profile import Profile
from urc.model.values import Value
from urc.runtime.catalog import built_in_catalog
from urc.runtime.selftest import sample_settings
from urc.runtime.session import Session
from urc.simulator.stand_in import stand_in
from urc.web.app import Robot, build_app, serve

__all__ = ["Place", "run_dashboard"]


@dataclass(frozen=True, slots=True)
class Place:
    """Where the dashboard is."""

    host: str
    port: int
    allowed_hosts: Sequence[str] = ()


def run_dashboard(
    profiles: Sequence[tuple[Profile, Mapping[str, Value]]],
    place: Place,
    *,
    is_simulated: bool,
    on_ready: Callable[[str], None],
) -> int:
    """Serve the dashboard until a signal ends it, which is fine: return 0.

    Args:
        profiles: each with the settings that are known.
        place: address, port and the names it answers to.
        is_simulated: each robot is emulated, over a real socket, instead of the real one.
        on_ready: called once with the address.

    Raises:
        UrcError: a port that cannot be had, two robots of one name.
    """
    names = [profile.name for profile, _ in profiles]
    for name in names:
        if names.count(name) > 1:
            raise Misuse(f"two robots are named {name!r}; a name must be unique")
    return run_loop(_serve(profiles, place, is_simulated, on_ready), code_when_ended=0)


async def _serve(
    profiles: Sequence[tuple[Profile, Mapping[str, Value]]],
    place: Place,
    is_simulated: bool,
    on_ready: Callable[[str], None],
) -> int:
    async with AsyncExitStack() as stack:
        transports = built_in_catalog().transports
        robots: dict[str, Robot] = {}
        for original, known in profiles:
            profile, settings = original, known
            if is_simulated:
                # What only a real robot needs to be told, nobody must fill in for its twin.
                settings = sample_settings(profile.settings) | dict(known)
                profile = await stack.enter_async_context(stand_in(profile, settings))
            session = partial(Session, profile, settings, transports)
            robots[profile.name] = Robot(profile, settings, session)
        app = build_app(robots, allowed_hosts=place.allowed_hosts)
        await serve(app, host=place.host, port=place.port, on_ready=on_ready)
    return 0
