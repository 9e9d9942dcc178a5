"""The warning about emulated robots whose cameras and laser scanners do not work.

Layer 6. Simulated cameras and laser scanners require a separate extra, because real robots do not
need the extra; see docs/decisions/0045.
"""

from collections.abc import Iterable

from urc._extras import install_command
from urc.cli.output import complain
from urc.model.profile import Profile
from urc.simulator.simulated_body import has_rendering, rendered_signals

__all__ = ["warn_without_rendering"]


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
