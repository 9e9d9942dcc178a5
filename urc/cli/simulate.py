"""`urc simulate`: the emulated robot of a profile, on its real ports."""

import argparse
import asyncio
from collections.abc import Mapping
from typing import TYPE_CHECKING

from urc.cli.arguments import add_host, add_profile, load

if TYPE_CHECKING:
    from urc.model.profile import Profile
    from urc.model.values import Value

EXAMPLE = "urc simulate robots/puppet.yaml --set port=6789"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the profile and the address."""
    add_profile(parser)
    add_host(parser)


def run(arguments: argparse.Namespace) -> int:
    """Emulate the robot until Ctrl-C or SIGTERM."""
    from urc.cli.running import run_loop
    from urc.cli.settings import settings_given
    from urc.runtime.selftest import sample_settings

    profile = load(arguments.profile)
    ((values, missing),) = settings_given([profile], arguments, allows_any_port=True)
    # What only a real robot needs to be told, nobody must fill in for its twin.
    settings = sample_settings(profile.settings) | values
    settings |= {name: 0 for name in missing if profile.settings[name].type == "port"}
    return run_loop(_simulate(profile, settings, arguments.host), code_when_ended=0)


async def _simulate(profile: "Profile", settings: Mapping[str, "Value"], host: str) -> int:
    from urc.simulator.server import serve

    async with serve(profile, settings, host) as listening:
        for name, (address, port) in listening.items():
            kind = profile.driver.transports[name].type
            shown = f"[{address}]" if ":" in address else address
            print(f"listening {name} {kind} {shown}:{port}", flush=True)
        await asyncio.Event().wait()
    return 0
