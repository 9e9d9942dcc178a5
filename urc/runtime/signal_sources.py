"""The transports that supply the readings of each signal.

Layer 4. Pure.
"""

from urc.model.driver import Command, Driver, Poll

__all__ = ["sources_of"]


def sources_of(driver: Driver) -> dict[str, tuple[str, ...]]:
    """Return the transports whose messages or replies set each signal, keyed by signal."""
    asked: tuple[Poll | Command, ...] = (*driver.polls, *driver.commands.values())
    reads = [(message.transport, message.read) for message in driver.messages.values()]
    reads += [(each.transport, each.reply.read) for each in asked if each.reply]
    found: dict[str, dict[str, None]] = {}
    for transport, read in reads:
        for field in read.fields:
            found.setdefault(field, {})[transport] = None
    for name in driver.signals:
        _add_sources(name, driver, found)
    return {name: tuple(transports) for name, transports in found.items()}


def _add_sources(name: str, driver: Driver, found: dict[str, dict[str, None]]) -> dict[str, None]:
    """Return the transports that supply a signal; a computed signal uses its inputs' transports."""
    signal = driver.signals.get(name)
    if signal is not None and signal.formula is not None and name not in found:
        found[name] = {}
        for other in sorted(signal.inputs):
            found[name] |= _add_sources(other, driver, found)
    return found.get(name, {})
