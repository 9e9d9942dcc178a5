"""A driver without what it does by itself: for tests of single frames, and nothing else.

Floor 3, pure.
"""

from urc.model.driver import Driver

__all__ = ["alone"]


def alone(driver: Driver, *, keeps_conditions: bool) -> Driver:
    """Return the driver with lines that are usable at once, and nothing said unasked.

    Args:
        driver: as loaded.
        keeps_conditions: whether commands still require and verify what they do; a test of bytes
            has no robot that could tell it the signals.
    """
    transports = {
        name: spec._replace(on_connect=(), on_close=(), keepalive=None, stale_after_s=None)
        for name, spec in driver.transports.items()
    }
    commands = driver.commands
    if not keeps_conditions:
        commands = {
            name: command._replace(requires=(), verify=None) for name, command in commands.items()
        }
    polls = tuple(poll._replace(phase_s=0.0, when=None) for poll in driver.polls)
    return driver._replace(transports=transports, commands=commands, polls=polls)
