"""A profile that connects to an emulated robot on free ports.

Layer 4. `urc demo` and `urc serve --simulate` use free ports. `urc simulate` uses the profile's
ports instead.
"""

from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager

from urc.model.profile import Profile
from urc.model.values import Value
from urc.simulator.emulated_robot import EmulatedRobot
from urc.simulator.server import serve

__all__ = ["stand_in"]


@asynccontextmanager
async def stand_in(
    profile: Profile, settings: Mapping[str, Value], emulated_robot: EmulatedRobot | None = None
) -> AsyncIterator[Profile]:
    """Emulate a robot until the context ends and yield a profile that connects to it.

    Args:
        profile: profile of the robot.
        settings: values of the profile's settings.
        emulated_robot: emulated robot to use; None to create one from the profile.

    Raises:
        UrcError: a transport cannot be emulated.
    """
    async with serve(
        profile, settings, is_anywhere=True, emulated_robot=emulated_robot
    ) as listening:
        places = {name: endpoint.options for name, endpoint in listening.items()}
        yield _redirected(profile, places)


def _redirected(profile: Profile, options: Mapping[str, Mapping[str, object]]) -> Profile:
    transports = {
        name: spec._replace(options={**spec.options, **options[name]})
        for name, spec in profile.driver.transports.items()
    }
    return profile._replace(driver=profile.driver._replace(transports=transports))
