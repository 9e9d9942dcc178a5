"""A robot with one transport, built without a YAML document."""

from urc.expressions import compile_template
from urc.model.driver import (
    Argument,
    Backoff,
    Command,
    Driver,
    FramingSpec,
    Message,
    Poll,
    Reply,
    Timeouts,
    TransportSpec,
)
from urc.model.payload import ReadSpec, WriteSpec
from urc.model.profile import Profile, Reaction, Setting, SimulatorRule
from urc.model.values import Signal
from urc.patterns import compile_pattern

__all__ = ["line_profile", "regex", "text"]


def regex(source: str) -> ReadSpec:
    """Return the ``regex`` form of a reply or message."""
    pattern = compile_pattern(source)
    return ReadSpec("regex", {"pattern": pattern}, pattern.groups)


def text(source: str) -> WriteSpec:
    """Return the ``text`` form of a frame to send."""
    template = compile_template(source)
    return WriteSpec("text", {"template": template}, template.names, template.settings)


QUESTION = "Give me the battery %"


def line_profile(
    *,
    is_per_request: bool = False,
    every_s: float | None = 1.0,
    timeouts: Timeouts | None = None,
    backoff: Backoff | None = None,
    transport: str = "tcp",
    max_bytes: int = 65536,
) -> Profile:
    """Return a profile like the puppet's: lines of text, two signals, one poll and two commands.

    Args:
        is_per_request: whether each request opens a separate connection.
        every_s: period of the poll, in seconds; None for a robot without polls.
        timeouts: timeouts of the only transport, which is named ``wire``.
        backoff: delays between attempts to reconnect; None for the defaults.
        transport: type of the transport, such as ``tcp``.
        max_bytes: maximum size of a frame, in bytes.
    """
    wire = TransportSpec(
        name="wire",
        type=transport,
        options={
            "host": compile_template("{{ settings.host }}"),
            "port": compile_template("{{ settings.port }}"),
        },
        connection="per_request" if is_per_request else "persistent",
        framing=FramingSpec("delimiter", {"tx": b"\n", "rx": b"\n"}, max_bytes),
        timeouts=timeouts or Timeouts(),
        backoff=backoff or Backoff(),
    )
    rule = SimulatorRule(
        "wire",
        compile_pattern(f"^{QUESTION}$"),
        reactions=(Reaction(send=text("{{ (now | int) % 100 }}")),),
    )
    return Profile(
        name="liner",
        title="Liner",
        file="liner.yaml",
        settings={
            "host": Setting("host", "host", default="127.0.0.1"),
            "port": Setting("port", "port"),
        },
        driver=_driver(wire, every_s),
        simulator=(rule,),
    )


def _driver(wire: TransportSpec, every_s: float | None) -> Driver:
    battery = Reply(regex(r"^(?P<battery>\d+)$"))
    commands = {
        "ask": Command("ask", "wire", text(QUESTION), reply=battery),
        "say": Command(
            "say",
            "wire",
            text("say {{ word }}"),
            arguments={"word": Argument("word", "string")},
        ),
    }
    polls = () if every_s is None else (Poll("polls.0", "wire", every_s, text(QUESTION), battery),)
    return Driver(
        transports={"wire": wire},
        signals={
            "battery": Signal("battery", "integer", unit="%", stale_after_s=3.0),
            "note": Signal("note", "string", stale_after_s=3.0),
        },
        commands=commands,
        messages={"note": Message("note", "wire", regex(r"^note (?P<note>.*)$"))},
        polls=polls,
    )
