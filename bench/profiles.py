"""Different generated profiles of about 130 lines each, for the benchmarks of `urc validate`."""

from pathlib import Path

__all__ = ["write_profiles"]

_HEAD = """\
# A generated profile of a benchmark.
urc: 1
kind: robot
name: robot-{number}
title: Robot {number}
summary: The generated robot number {number}, with {count} sensors on one line.

settings:
  host: {{ type: host, default: 127.0.0.1, title: Robot address }}
  port: {{ type: port, default: {port} }}

transports:
  wire:
    type: tcp
    host: "{{{{ settings.host }}}}"
    port: "{{{{ settings.port }}}}"
    framing: {{ type: delimiter, tx: LF, rx: CRLF }}
    timeouts: {{ connect: 3s, reply: {reply}ms }}

signals:
"""
_SIGNAL = """\
  sensor_{place}:
    type: number
    unit: "V"
    min: {low}
    max: {high}
    precision: 2
    limits: {{ low: {warn}, lolo: {alarm}, hysteresis: 0.5 }}
"""
_MESSAGE = """\
  report_{place}:
    pattern: "S{number}_{place} {{sensor_{place}:number}}"
"""
_COMMAND = """\
  move_{place}:
    send: "M{number}_{place} {{{{ (speed * {factor}) | fixed(1) }}}} {{{{ turn | fixed(2) }}}}"
    args:
      speed: {{ min: -1, max: 1, unit: m/s }}
      turn: {{ min: -2, max: 2, unit: rad/s }}
"""
_TEST = """\
  - name: sensor {place} reports
    feed: {{ wire: "S{number}_{place} {value}\\r\\n" }}
    expect: {{ sensor_{place}: {value} }}
"""
_SENSORS = 8
_COMMANDS = 5


def write_profiles(folder: Path, count: int) -> list[str]:
    """Write `count` different profiles into `folder`, and return their paths."""
    paths = []
    for number in range(count):
        path = folder / f"robot-{number:03}.yaml"
        path.write_text(_text(number), encoding="utf-8")
        paths.append(str(path))
    return paths


def _text(number: int) -> str:
    numbers = range(_SENSORS)
    parts = [_HEAD.format(number=number, count=_SENSORS, port=6000 + number, reply=400 + number)]
    parts += [
        _SIGNAL.format(place=place, low=-number, high=number + 60, warn=place + 5, alarm=place + 1)
        for place in numbers
    ]
    parts.append("\nmessages:\n")
    parts += [_MESSAGE.format(number=number, place=place) for place in numbers]
    parts.append("\ncommands:\n")
    parts += [
        _COMMAND.format(number=number, place=place, factor=100 + number)
        for place in range(_COMMANDS)
    ]
    parts.append("\ntests:\n")
    parts += [_TEST.format(number=number, place=place, value=place + 12.5) for place in range(4)]
    return "".join(parts)
