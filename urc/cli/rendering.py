"""The warnings about emulated robots whose cameras and laser scanners do not work.

Layer 6. Simulated cameras and laser scanners require separate extras, because most real robots do
not need the extras; see docs/decisions/0045 and 0073.
"""

from collections.abc import Iterable

from urc._extras import install_command
from urc.cli.output import complain
from urc.model.profile import Profile
from urc.simulator.simulated_body import has_rendering, rendered_signals

__all__ = ["warn_without_encoder", "warn_without_rendering"]


def warn_without_rendering(profiles: Iterable[Profile]) -> None:
    """Report emulated robots whose cameras or laser scanners do not work on this machine."""
    if has_rendering():
        return
    blind = [one.name for one in profiles if one.world and rendered_signals(one.world)]
    if blind:
        complain(
            f"urc: the cameras and laser scanners of {', '.join(blind)} require numpy and Pillow;"
            f" to install both: {install_command('demo')}"
        )


def warn_without_encoder(profile: Profile) -> None:
    """Report an emulated robot whose cameras send no video on this machine."""
    from urc.simulator.servers.camera import has_encoder  # only for emulated robots

    if has_encoder() or not any(one.is_camera for one in profile.driver.transports.values()):
        return
    complain(
        f"urc: the emulated {profile.name} sends no video, which requires av; to install it:"
        f" {install_command('video')}"
    )
