"""Injection and removal of faults in an emulated robot.

Pure.
"""

import re
from collections.abc import Iterator

from urc.config.spelling_suggestions import did_you_mean
from urc.model.world import READINGS, WorldSpec
from urc.problems import UrcError
from urc.simulator.faults import Fault
from urc.simulator.values import Values

__all__ = ["inject", "mend"]


def inject(fault: Fault, values: Values, now_s: float) -> None:
    """Inject `fault` into the emulated robot whose values are `values`.

    Raises:
        UrcError: the fault is impossible for this robot.
    """
    body, faults = values.body, values.faults
    if fault.name in ("noise", "low-battery") and body is None:
        raise UrcError(f"fault {fault.name}: this robot has no world")
    if fault.name == "dropout":
        faults.dropped |= {*_dropped(fault.signal, values)}
    elif fault.name == "stuck":
        _check_signal(fault, values)
        faults.stuck[fault.signal] = values.of(fault.signal, now_s)
    elif body is not None and fault.name == "noise":
        body.world.noise = fault.amount
    elif body is not None and fault.name == "low-battery":
        body.world.low_battery()
    faults.add(fault)


def mend(values: Values) -> None:
    """Remove all faults."""
    values.faults.clear()
    if values.body is not None:
        values.body.world.noise = 1.0
        values.body.world.dropped = set(values.body.world.missing)


def _check_signal(fault: Fault, values: Values) -> None:
    signals = values.driver.signals
    if fault.signal not in signals:
        hint = did_you_mean(fault.signal, signals, "signals")
        text = f"fault {fault.name}: there is no signal {fault.signal!r}"
        raise UrcError(f"{text}; {hint}" if hint else text)


def _dropped(name: str, values: Values) -> Iterator[str]:
    """Yield the signals that lose their values when the signal or sensor `name` fails."""
    body = values.body
    if body is not None and name not in values.driver.signals and name in READINGS:
        body.world.dropped.add(name)
        yield from _told_by(name, body.spec)
        return
    _check_signal(Fault("dropout", signal=name), values)
    yield name


def _told_by(sensor: str, spec: WorldSpec) -> Iterator[str]:
    reading = re.compile(rf"_item\(ns\['world'\], '{sensor}'\)")
    yield from (name for name, one in spec.senses.items() if reading.search(one.python))
