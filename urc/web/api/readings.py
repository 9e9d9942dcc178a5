"""Latest signal values in the HTTP API's format.

Layer 5. Pure.
"""

from collections.abc import Iterable, Mapping
from typing import Final

from urc.model.values import Sample, Signal
from urc.runtime.hub import Hub
from urc.web.api.wire import SignalValue
from urc.web.wire.text import repaired

__all__ = ["plain", "value_of", "values_of"]

_LARGEST: Final = 2**64 - 1
_SMALLEST: Final = -(2**63)


def value_of(signal: Signal, sample: Sample | None, now_s: float) -> SignalValue:
    """Return the latest value of a signal.

    Args:
        signal: the signal.
        sample: the signal's newest sample; None if no sample has arrived.
        now_s: current time on the clock of the readings, in seconds.
    """
    if sample is None:
        return SignalValue(None, None, stale=True)
    age_s = max(0.0, now_s - sample.time_s)
    is_stale = bool(signal.stale_after_s) and age_s > signal.stale_after_s
    return SignalValue(plain(sample.value), round(age_s, 4), is_stale, sample.alarm)


def values_of(hub: Hub, names: Iterable[str], now_s: float) -> dict[str, SignalValue]:
    """Return the latest values of several signals."""
    return {name: value_of(hub.signals[name], hub.latest(name), now_s) for name in names}


def plain(value: object) -> object:
    """Return a JSON-compatible value; bytes are replaced by their size."""
    if isinstance(value, (bytes, bytearray)):
        return {"bytes": len(value)}
    if isinstance(value, Mapping):
        return {str(repaired(str(name))): plain(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if type(value) is int and not _SMALLEST <= value <= _LARGEST:
        return str(value)
    if value is None or isinstance(value, (bool, int, float)):
        return value
    return repaired(str(value))
