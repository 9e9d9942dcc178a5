"""Compare expected and actual results in a document's tests.

Layer 4, pure. Each mismatch message contains the expected and the actual value. Callers put the
message into a longer text.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from urc.config.values import shown
from urc.model.driver import Driver
from urc.model.payload import Envelope, Payload, traffic_of
from urc.model.profile import Expected, ExpectedState, Fed, pieces_of
from urc.problems import UrcError
from urc.protocol.events import Failed, Replied
from urc.protocol.framing.base import FramingError
from urc.protocol.framing.table import build_framing
from urc.runtime.signal_hints import SignalHints
from urc.runtime.test_engine import TestEngine, encoded

__all__ = ["check_bytes", "check_reply", "check_values", "first", "is_same"]

_SINGLE: Final = 1e-7
"""Relative difference that counts as equal, because four-byte floating-point numbers are
rounded."""
_SHOWN: Final = 3
"""Maximum number of reported failures per test."""
_SHOWN_BYTES: Final = 48
_BEFORE_BYTES: Final = 16
"""Number of bytes of a long frame that are displayed before the first difference; `_SHOWN_BYTES` is
the total number."""


def first(failures: list[str]) -> list[str]:
    """Return the first failures, followed by the number of other failures."""
    more = len(failures) - _SHOWN
    return [*failures[:_SHOWN], f"and {more} more"] if more > 0 else list(failures)


def check_values(
    trial: TestEngine, expect: Mapping[str, Expected], hints: SignalHints
) -> Iterator[str]:
    """Yield a message for each signal whose value or alarm differs from the expectation."""
    for name, wanted in expect.items():
        state = (
            wanted
            if isinstance(wanted, ExpectedState)
            else ExpectedState(has_value=True, value=wanted)
        )
        sample = trial.samples.get(name)
        if sample is None:
            if state.age != "never":
                yield f"{name}: expected {_wanted(state)}, but nothing set it{hints.of(name)}"
            continue
        if state.has_value and not is_same(sample.value, state.value):
            yield f"{name}: expected {shown(state.value)}, found {shown(sample.value)}"
        if state.alarm is not None and state.alarm != sample.alarm:
            found = sample.alarm or "none"
            yield f"{name}: expected the alarm {state.alarm or 'none'}, found {found}"
        age_s = trial.now - sample.time_s
        longest_s = trial.driver.signals[name].stale_after_s
        age = "stale" if age_s > longest_s else "fresh"
        if state.age and state.age != age:
            if state.age == "never":
                yield f"{name}: expected no value, found {shown(sample.value)}"
            else:
                told = f"the value is {age_s:g} s old (stale after {longest_s:g} s)"
                yield f"{name}: it should be {state.age}, but {told}"


def _wanted(state: ExpectedState) -> str:
    if state.has_value:
        return shown(state.value)
    return f"the alarm {state.alarm or 'none'}" if state.alarm is not None else "a value"


def check_bytes(
    trial: TestEngine, driver: Driver, sent: Mapping[str, Fed | tuple[Fed, ...]]
) -> Iterator[str]:
    """Yield a message for each transport that sent unexpected data; discard the compared data."""
    for name, text in sent.items():
        found = trial.sent.pop(name, [])
        pieces = pieces_of(text)
        messages = [one for one in pieces if isinstance(one, Envelope)]
        if messages or any(isinstance(one, Envelope) for one in found):
            yield from _check_messages(name, messages, found)
            continue
        try:
            wanted = b"".join(
                _framed(piece, driver, name) for piece in pieces if not isinstance(piece, Envelope)
            )
        except UrcError as error:
            yield str(error)
            continue
        on_wire = _on_wire(found)
        if on_wire != wanted:
            yield _difference(name, wanted, on_wire)


def check_reply(
    ended: list[Replied | Failed],
    wanted: Mapping[str, object],
    of: str,
) -> Iterator[str]:
    """Yield the mismatches of the first finished command and discard its result."""
    place = next((place for place, one in enumerate(ended) if of in ("", one.command)), None)
    if place is None:
        yield f"{of or 'the command'} should have ended, but no reply arrived or no command was run"
        return
    one = ended.pop(place)
    if isinstance(one, Failed):
        yield f"{one.command} should have succeeded, but it failed"
        return
    for name, value in wanted.items():
        if name not in one.values:
            known = ", ".join(one.values) or "none"
            yield f"the reply of {one.command} has no {name!r}; it has: {known}"
        elif not is_same(one.values[name], value):
            found = shown(one.values[name])
            yield f"{name}: expected {shown(value)} in the reply of {one.command}, found {found}"


def _check_messages(transport: str, wanted: list[Envelope], found: list[Payload]) -> Iterator[str]:
    """Yield a message about the first unexpected envelope."""
    for place in range(max(len(wanted), len(found))):
        one = wanted[place] if place < len(wanted) else None
        other = found[place] if place < len(found) else None
        if one is not None and isinstance(other, Envelope) and _is_message(other, one):
            continue
        sides = (_message_shown(side) for side in (one, other))
        yield "{}: expected {}, found {}".format(transport, *sides)
        return


def _is_message(found: Envelope, wanted: Envelope) -> bool:
    """Return whether a sent message has all expected attributes and the expected body."""
    given = wanted.attributes
    return (
        found.verb == wanted.verb
        and all(_is_alike(found.attributes.get(name), given[name]) for name in given)
        and _is_alike(found.body, wanted.body)
    )


def _is_alike(found: object, wanted: object) -> bool:
    """Compare data with the tolerance rules for numbers in tests."""
    if isinstance(found, Mapping) and isinstance(wanted, Mapping):
        return found.keys() == wanted.keys() and all(
            _is_alike(found[name], wanted[name]) for name in wanted
        )
    if isinstance(found, (list, tuple)) and isinstance(wanted, (list, tuple)):
        return len(found) == len(wanted) and all(map(_is_alike, found, wanted))
    return is_same(found, wanted)


def _message_shown(payload: Payload | None) -> str:
    return "nothing" if payload is None else traffic_of(payload).decode("utf-8", "replace")


def _on_wire(sent: Iterable[Payload]) -> bytes:
    return b"".join(traffic_of(one) for one in sent)


def _framed(text: str | bytes, driver: Driver, transport: str) -> bytes:
    """Return the bytes that the test expects to be sent, including framing.

    Bytes are used unchanged; text is the payload of one frame.
    """
    if isinstance(text, bytes):
        return text
    payload = encoded(text, driver, transport)
    try:
        return build_framing(driver.transports[transport].framing).encode(payload)
    except FramingError as error:
        raise UrcError(f"{transport}: {error}") from error


def is_same(found: object, expected: object) -> bool:
    """Compare values: 42 equals 42.0, true differs from 1, and fractions may differ slightly."""
    if isinstance(found, tuple) and isinstance(expected, tuple):
        return len(found) == len(expected) and all(map(is_same, found, expected))
    if isinstance(found, bool) != isinstance(expected, bool):
        return False
    if isinstance(found, float) and isinstance(expected, (int, float)):
        return math.isclose(found, expected, rel_tol=_SINGLE, abs_tol=1e-12)
    return found == expected


def _difference(transport: str, wanted: bytes, found: bytes) -> str:
    """Return expected and actual bytes in hex and as text, around the first difference."""
    at = next((i for i, (a, b) in enumerate(zip(wanted, found, strict=False)) if a != b), None)
    offset = min(len(wanted), len(found)) if at is None else at
    start = max(0, offset - _BEFORE_BYTES) if max(len(wanted), len(found)) > _SHOWN_BYTES else 0
    sides = f"expected {_bytes_shown(wanted, start)}, found {_bytes_shown(found, start)}"
    return f"{transport}: at byte {offset}, {sides}"


def _bytes_shown(data: bytes, start: int) -> str:
    """Return the bytes from `start`, with dots in place of omitted bytes."""
    if not data:
        return "nothing"
    part = data[start : start + _SHOWN_BYTES]
    before, after = "… " if start else "", " …" if start + len(part) < len(data) else ""
    text = part.decode("ascii", "backslashreplace")
    return f"{before}{text!r} ({part.hex(' ')}){after}"
