"""The driving lock: how the age of the image that an operator sees limits a held command.

Theory of operation. The server remembers when it sent each image to a page, and how old the image
was. With each tick, the page names the image that it shows, and for how long it has shown it. The
page states no age and no time of day: the server computes the age of the named image on its own
clock. A page therefore cannot claim a fresher image than it has received. A page that names no
image, or an image that it cannot show yet, is blind.

The permitted speed falls linearly between two ages. Motion ends at the second age.
"""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple, TypeGuard

from urc.model.exchange import Sight
from urc.model.values import Reading

__all__ = [
    "BLIND_S",
    "Permit",
    "SeenImage",
    "SentImages",
    "permit_between",
    "permit_of",
    "slowed",
]

BLIND_S: Final = math.inf
"""Age of the image on a page that shows no image."""
_MOST_IMAGES: Final = 512
"""Number of images of each signal that are remembered: at 60 a second, more than the highest age at
which a motion may end."""
_ROUNDING_S: Final = 0.002
"""Maximum error of a page's time, which browsers round."""


class SeenImage(NamedTuple):
    """The image that a page shows, as reported with a tick."""

    number: int
    """Number of the image, from the message that contained it."""
    shown_s: float
    """Time for which the page has shown the image, in seconds."""


class Permit(NamedTuple):
    """The motion that an image or a tick of a certain age permits."""

    share: float
    """Permitted share of the requested speed, from 0 to 1."""
    for_s: float
    """Time until the image or tick is too old, in seconds; 0 if it is too old."""


_NO_PERMIT: Final = Permit(0.0, 0.0)


class _Sent(NamedTuple):
    time_s: float
    sent_s: float


class SentImages:
    """The images that one page has received of the signals in `signals`, and their ages."""

    def __init__(self, signals: frozenset[str] = frozenset()) -> None:
        self.signals = signals
        """Signals that some held command requires the operator to see."""
        self._sent: dict[str, dict[int, _Sent]] = {}

    def sent(self, signal: str, number: int, time_s: float, now: float) -> None:
        """Record that the image `number` of `signal` is sent to the page.

        Args:
            signal: the image's signal; other signals than `signals` are ignored.
            number: number of the image, as in its message.
            time_s: time at which the image was taken, or reached this computer.
            now: the current time on the same clock.
        """
        if signal not in self.signals:
            return
        sent = self._sent.setdefault(signal, {})
        # A stamp in the future must not make an image younger than its transmission.
        sent.setdefault(number, _Sent(min(time_s, now), now))
        if len(sent) > _MOST_IMAGES:
            del sent[next(iter(sent))]

    def forget(self, signal: str) -> None:
        """Forget the images of a signal, because the page receives them in another form."""
        self._sent.pop(signal, None)

    def age_s(self, signal: str, seen: SeenImage | None, now: float) -> float:
        """Return the age of the image that the page shows, in seconds.

        Returns:
            `BLIND_S` if the page names no image, or an image that it cannot have shown for so long.
        """
        if seen is None:
            return BLIND_S
        sent = self._sent.get(signal, {}).get(seen.number)
        if sent is None:
            return BLIND_S
        if not 0 <= seen.shown_s <= now - sent.sent_s + _ROUNDING_S:
            return BLIND_S
        return now - sent.time_s


def permit_of(sight: Sight, age_s: float) -> Permit:
    """Return the motion that an image with the age `age_s` permits; none at an age of NaN."""
    return permit_between(age_s, sight.slow_after_s, sight.stop_after_s)


def permit_between(age_s: float, slow_after_s: float | None, stop_after_s: float) -> Permit:
    """Return the motion that an age permits; none at an age of NaN.

    Args:
        age_s: age in seconds.
        slow_after_s: age from which the permitted speed falls linearly; None for full speed.
        stop_after_s: age from which nothing is permitted.
    """
    if not age_s < stop_after_s:
        return _NO_PERMIT
    left_s = stop_after_s - age_s
    if slow_after_s is None or age_s <= slow_after_s:
        return Permit(1.0, left_s)
    return Permit(left_s / (stop_after_s - slow_after_s), left_s)


def slowed(
    arguments: Mapping[str, Reading], rests: Mapping[str, Reading], share: float
) -> dict[str, Reading]:
    """Return `arguments` with the distance from rest of each speed multiplied by `share`.

    Integers are rounded towards rest. Non-numeric values stay unchanged, because the argument check
    refuses them later.

    Args:
        arguments: the requested values.
        rests: value at rest of each argument that sets a speed; 0 for a value without number.
        share: from 0 to 1.
    """
    found = dict(arguments)
    for name in rests.keys() & arguments.keys():
        wanted, rest = arguments[name], rests[name]
        if not isinstance(wanted, (tuple, list)):
            found[name] = _slowed(wanted, rest, share)
            continue
        all_rests = rest if isinstance(rest, (tuple, list)) else (rest,) * len(wanted)
        padded = [*all_rests, *[0] * len(wanted)]
        found[name] = tuple(_slowed(one, padded[place], share) for place, one in enumerate(wanted))
    return found


def _slowed(wanted: Reading, rest: object, share: float) -> Reading:
    if not _is_number(wanted):
        return wanted  # refused later
    base = rest if _is_number(rest) else 0
    far = (wanted - base) * share
    return int(base) + math.trunc(far) if isinstance(wanted, int) else base + far


def _is_number(value: object) -> TypeGuard[int | float]:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    return math.isfinite(value)
