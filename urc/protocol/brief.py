"""The short way of a command: what nearly every command is, done in one step.

Floor 3, pure. A persistent line is up and nothing is under way on it; the bytes depend on nothing
but the arguments; nothing must hold before it is sent or come true after it. Then the outcome of
all that `urc.protocol.engine` would look at is known, and only the frame is made and noted as sent.
Whatever is otherwise takes the long way, which is also the oracle of the tests.
"""

from collections.abc import Callable, Mapping

from urc.expressions import Template
from urc.model.codec import Payload
from urc.model.driver import Command, Driver
from urc.model.values import NOTHING, Reading
from urc.protocol.commands import is_guarded
from urc.protocol.encode import BadArgument
from urc.protocol.events import Event, Replied, Request, Send
from urc.protocol.exchange import Ask, Asked, Exchange
from urc.protocol.generate import WARM_AFTER
from urc.protocol.line import Line

__all__ = ["Brief", "Write", "briefs", "made_for"]

Check = Callable[[Mapping[str, object]], dict[str, Reading]]
Write = Callable[[Mapping[str, object]], Payload | None]
"""Arguments → bytes, framing included, or None for what the check must look at."""

new = tuple.__new__
"""Makes a named tuple without the detour through its class: this is done for every command."""


def briefs(
    driver: Driver, lines: Mapping[str, Line], asks: Mapping[str, Ask], checks: Mapping[str, Check]
) -> dict[str, "Brief"]:
    """Return the commands that may take the short way, by name."""
    return {
        name: Brief(lines[command.transport], asks[name], checks[name], command)
        for name, command in driver.commands.items()
        if name in asks
        and asks[name].is_simple
        and lines[command.transport].spec.queue.most_bytes is None
        and not is_guarded(command)
        and command.verify is None
    }


class Brief:
    """A command that needs nothing but to be written, on its line."""

    def __init__(
        self,
        line: Line,
        ask: Ask,
        check: Check,
        command: Command,
    ) -> None:
        """Take a command whose `Ask.is_simple`, and the check of its arguments."""
        self._line = line
        self._ask = ask
        self._name = line.spec.name
        self._check = check
        self._command = command
        self._cold = WARM_AFTER
        """How often it has still to be used until it pays to make a function for it."""
        self._write: Write | None = None

    def send(self, request: Request, now: float) -> list[Event] | None:
        """Send it if its line is idle, and return what is to be told.

        Returns:
            None, with nothing done, where the long way must find out why not.
        """
        line = self._line
        if not line.is_idle(now):
            return None
        given, data = request.arguments, None
        if self._write is not None:
            data = self._write(given)
        if data is None:
            try:
                data = self._ask.encode(self._check(given))
            except BadArgument:
                return None
            if self._cold:
                self._warm_up()
        ask = self._ask
        # Nothing will look at its namespace: no counter, and no answer that must be told by it.
        line.send_idle(Exchange(ask, Asked(request), NOTHING, data, now + ask.queue_s), now)
        if request.on_sent is not None:
            request.on_sent(data)
        sent = new(Send, (self._name, data, False, None))
        return [sent] if ask.answers else [sent, Replied(request.id, request.command)]

    def _warm_up(self) -> None:
        self._cold -= 1
        if not self._cold:
            self._write = made_for(self._command, self._line)


def made_for(command: Command, line: Line) -> Write | None:
    """Return a function of `command` alone, which checks and writes; None where there is none."""
    template = command.send.options.get("template")
    if command.send.form != "text" or not isinstance(template, Template):
        return None
    from urc.protocol.fast_encode import build_fast_write

    return build_fast_write(template, command.arguments, line.framing, line.spec.encoding)
