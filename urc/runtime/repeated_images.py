"""Cameras that repeat the same image, although new messages arrive.

Layer 4. Pure. A camera whose sensor or encoder has stopped may send its last image for ever, each
time as a new message. The images of a real sensor differ, because of its noise. If an image
declares ``frozen_after``, images with the same bytes count as one image, as soon as they have
arrived for this time. Its age counts from its first arrival.
"""

from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

from urc.model.values import Sample, Signal

__all__ = ["Aged", "RepeatedImages"]

_BEGUN: Final = "the camera repeats the same image; its age counts from its first arrival"
_ENDED: Final = "the camera sends new images again, after {:.1f} s"


class Aged(NamedTuple):
    """Samples with their true ages, and lines for the log as pairs of signal and text."""

    samples: tuple[Sample, ...]
    notes: tuple[tuple[str, str], ...] = ()


class RepeatedImages:
    """The images that are being repeated, among those with ``frozen_after``."""

    def __init__(self, signals: Mapping[str, Signal]) -> None:
        """Begin without images."""
        self._after_s = {
            name: one.frozen_after_s
            for name, one in signals.items()
            if one.frozen_after_s and one.type == "image"
        }
        self._first: dict[str, Sample] = {}
        """First sample with the newest image, keyed by signal."""
        self._repeated: set[str] = set()

    def __bool__(self) -> bool:
        """Return whether some image declares ``frozen_after``."""
        return bool(self._after_s)

    def __contains__(self, signal: str) -> bool:
        """Return whether a camera repeats the signal's image."""
        return signal in self._repeated

    def aged(self, samples: Iterable[Sample]) -> Aged:
        """Return samples in which a repeated image has the age of its first arrival."""
        found: list[Sample] = []
        notes: list[tuple[str, str]] = []
        for sample in samples:
            after_s = self._after_s.get(sample.signal)
            found.append(sample if after_s is None else self._aged(sample, after_s, notes))
        return Aged(tuple(found), tuple(notes))

    def _aged(self, sample: Sample, after_s: float, notes: list[tuple[str, str]]) -> Sample:
        name, first = sample.signal, self._first.get(sample.signal)
        is_same = (
            first is not None
            and sample.value == first.value
            and sample.time_s >= first.time_s  # a recording may jump back
        )
        if first is None or not is_same:
            if first is not None and name in self._repeated:
                self._repeated.discard(name)
                notes.append((name, _ENDED.format(max(0.0, sample.time_s - first.time_s))))
            self._first[name] = sample
            return sample
        if sample.value is None or sample.time_s - first.time_s < after_s:
            return sample
        if name not in self._repeated:
            self._repeated.add(name)
            notes.append((name, _BEGUN))
        return sample._replace(time_s=first.time_s)
