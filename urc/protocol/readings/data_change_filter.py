"""Dead band and debounce filters for samples.

Callers pass the time, because the module does not read a clock. A signal's keys ``deadband`` and
``debounce`` declare the filters.
"""

from urc.model.values import Reading, Sample, Signal

__all__ = ["DataChangeFilter"]


class DataChangeFilter:
    """A change filter for one signal, with the last reported sample and the pending sample."""

    __slots__ = ("_band", "_pending", "_settle_s", "_since", "_told")

    def __init__(self, signal: Signal) -> None:
        self._band = signal.deadband
        self._settle_s = signal.debounce_s
        self._told: Sample | None = None
        self._pending: Sample | None = None
        self._since = 0.0
        """Arrival time of the first sample that had the pending value, in seconds."""

    @property
    def deadline(self) -> float | None:
        """Time at which `tick` reports the pending sample; None if no sample is pending."""
        return None if self._pending is None else self._since + self._settle_s

    def filter(self, sample: Sample, now: float) -> Sample | None:
        """Return the sample to report, with its own or the last reported value, or None."""
        told = self._told
        if told is not None and sample.alarm == told.alarm and self._is_same(sample, told):
            self._pending = None
            self._told = sample._replace(value=told.value)
            return self._told
        if told is None or not self._settle_s:
            return self._report(sample)
        if self._pending is None or not self._is_same(sample, self._pending):
            self._since = now
        self._pending = sample
        return self.tick(now)

    def tick(self, now: float) -> Sample | None:
        """Return the pending sample if its value has been stable long enough by `now`, or None."""
        due = self.deadline
        if self._pending is None or due is None or now < due:
            return None
        return self._report(self._pending)

    def _report(self, sample: Sample) -> Sample:
        self._pending = None
        self._told = sample
        return sample

    def _is_same(self, one: Sample, other: Sample) -> bool:
        return _is_within(one.value, other.value, self._band)


def _is_within(one: Reading, other: Reading, band: float) -> bool:
    if not band:
        return one == other
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(
            _is_within(a, b, band) for a, b in zip(one, other, strict=True)
        )
    if isinstance(one, (int, float)) and isinstance(other, (int, float)):
        return abs(one - other) < band
    return one == other
