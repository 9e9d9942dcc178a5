"""Runs the tests that a document carries, on the same engine that drives the robot.

Floor 4, no I/O and no asyncio: `urc validate` runs these without a robot, a network or a secret.
"""

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from urc.config.values import shown
from urc.model.driver import Driver, TransportSpec
from urc.model.profile import DocumentTest, Fed, Profile, Setting, pieces_of
from urc.model.values import Value
from urc.problems import Problem, UrcError
from urc.protocol.alone import alone
from urc.protocol.engine import Engine
from urc.protocol.events import Close, Event, Failed, Fault, Open, Request, Samples, Send
from urc.protocol.framing import FramingError, build_framing
from urc.runtime.coverage import Exercised, Listener

__all__ = ["Outcome", "exercise", "run_tests", "sample_settings"]

_SAMPLE: dict[str, Value] = {"host": "127.0.0.1", "port": 1, "integer": 0, "number": 0.0}
_ROUNDS = 16
"""How many deadlines a test lets pass while it waits for the failure that it declares."""
_SINGLE = 1e-7
"""Numbers of four bytes are exact to this share of themselves."""
_SHOWN = 3
"""Failures told of one test."""
_SHOWN_BYTES = 48
_BEFORE_BYTES = 16
"""Of a long frame: bytes shown, and how many of them before the first difference."""


class Outcome(NamedTuple):
    """What came of a document's own tests."""

    problems: list[Problem]
    """A finding for each one that failed."""
    exercised: frozenset[Exercised]
    """The commands, polls and messages that were used, whether the test passed or not."""


def run_tests(profile: Profile) -> list[Problem]:
    """Run every test of `profile`; return a finding for each one that fails."""
    return exercise(profile).problems


def exercise(profile: Profile) -> Outcome:
    """Run every test of `profile`; return what failed, and what was used."""
    settings = sample_settings(profile.settings)
    problems = []
    used: set[Exercised] = set()
    listener = Listener(profile.driver, settings)
    for test in profile.tests:
        used |= listener.exercised(test)
        complaint = _run(profile.driver, {**settings, **test.settings}, test)
        if complaint:
            problems.append(_problem(profile, test, complaint))
    return Outcome(problems, frozenset(used))


def sample_settings(settings: Mapping[str, Setting]) -> dict[str, Value]:
    """Return a value for every setting: its default, or something of its type."""
    values: dict[str, Value] = {}
    for name, setting in settings.items():
        if setting.default is not None:
            values[name] = setting.default
        elif setting.choices:
            values[name] = setting.choices[0]
        elif setting.type == "boolean":
            values[name] = False
        else:
            values[name] = _SAMPLE.get(setting.type, name)
    return values


def _problem(profile: Profile, test: DocumentTest, complaint: str) -> Problem:
    return Problem(
        "test-failed",
        f"test {test.name!r}: {complaint}",
        test.file or profile.file,
        line=test.line,
        column=test.column,
        path="tests",
        source=test.source,
    )


class _Trial:
    """An engine under test, and everything that it said."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self.samples: dict[str, object] = {}
        self.sent: dict[str, bytes] = {}
        self.failures: list[str] = []

    def perform(self, events: list[Event], now: float) -> None:
        """Do what a link would do, with a transport that always connects."""
        for event in events:
            match event:
                case Open(transport):
                    self.perform(self.engine.start(transport, now), now)
                case Send(transport, data):
                    self.sent[transport] = self.sent.get(transport, b"") + data
                case Samples(_, samples):
                    self.samples.update((sample.signal, sample.value) for sample in samples)
                case Fault(_, code, message) | Failed(_, _, code, message):
                    self.failures.append(f"{code}: {message}")
                case Close(_, reason) if reason:
                    self.failures.append(f"closed: {reason}")


def _run(driver: Driver, settings: Mapping[str, Value], test: DocumentTest) -> str:
    """Return what is wrong, or "" when the test passes."""
    if not (test.expect or test.sent or test.fails is not None):
        return "it checks nothing; say what it should 'expect', what is 'sent' or how it 'fails'"
    try:
        trial = _Trial(Engine(_narrowed(driver, test), settings))
        _converse(trial, driver, test)
    except UrcError as error:
        return str(error)
    if test.fails is None:
        complaints = _first(trial.failures)
    else:
        complaints = _check_failure(trial, test.fails)
    complaints += _check_values(trial, test)
    complaints += _check_bytes(trial, driver, test)
    return "; ".join(complaints)


def _narrowed(driver: Driver, test: DocumentTest) -> Driver:
    """Return the driver with only the poll that the test is about, due at once.

    A test that asks nothing is about what the robot says, and about the steps of its connections.
    """
    polls = (driver.polls[test.reply_to],) if isinstance(test.reply_to, int) else ()
    narrowed = driver._replace(polls=polls)
    if test.run is None and test.reply_to is None:
        return narrowed
    return alone(narrowed, keeps_conditions=test.fails is not None)


def _converse(trial: _Trial, driver: Driver, test: DocumentTest) -> None:
    """Connect, ask, and feed the answer, all in one instant."""
    trial.perform(trial.engine.tick(0.0), 0.0)
    for name, spec in driver.transports.items():
        if spec.connection == "persistent":
            trial.perform(trial.engine.start(name, 0.0), 0.0)
    command = test.run or (test.reply_to if isinstance(test.reply_to, str) else None)
    if command is not None:
        trial.perform(trial.engine.command(Request(1, command, test.arguments), 0.0), 0.0)
    for name, fed in test.feed.items():
        for piece in pieces_of(fed):
            data = _encoded(piece, driver.transports[name])
            trial.perform(trial.engine.receive(name, data, 0.0), 0.0)


def _check_failure(trial: _Trial, expected: str) -> list[str]:
    """Let time pass until the failure that the test declares, and complain if it never comes."""
    for _ in range(_ROUNDS):
        if any(expected in failure for failure in trial.failures):
            return []
        deadline = trial.engine.deadline
        if deadline is None:
            break
        trial.perform(trial.engine.tick(deadline), deadline)
    found = "; ".join(_first(trial.failures)) or "nothing failed"
    return [f"it should fail with {expected!r}, but {found}"]


def _first(failures: list[str]) -> list[str]:
    more = len(failures) - _SHOWN
    return [*failures[:_SHOWN], f"and {more} more"] if more > 0 else list(failures)


def _check_values(trial: _Trial, test: DocumentTest) -> Iterator[str]:
    for name, expected in test.expect.items():
        if name not in trial.samples:
            yield f"{name}: expected {shown(expected)}, but nothing set it"
        elif not _is_same(trial.samples[name], expected):
            yield f"{name}: expected {shown(expected)}, found {shown(trial.samples[name])}"


def _check_bytes(trial: _Trial, driver: Driver, test: DocumentTest) -> Iterator[str]:
    for name, text in test.sent.items():
        spec = driver.transports[name]
        try:
            wanted = _framed(text, spec)
        except UrcError as error:
            yield str(error)
            continue
        found = trial.sent.get(name, b"")
        if found != wanted:
            yield _difference(name, wanted, found)


def _framed(text: Fed, spec: TransportSpec) -> bytes:
    """Return every byte on the wire: bytes are that already, text is a frame's payload."""
    if isinstance(text, bytes):
        return text
    payload = _encoded(text, spec)
    try:
        return build_framing(spec.framing).encode(payload)
    except FramingError as error:
        raise UrcError(f"{spec.name}: {error}") from error


def _encoded(text: Fed, spec: TransportSpec) -> bytes:
    if isinstance(text, bytes):
        return text
    try:
        return text.encode(spec.encoding)
    except UnicodeEncodeError as error:
        wrong = text[error.start : error.end]
        raise UrcError(f"{spec.name}: {wrong!r} cannot be written in {spec.encoding}") from error


def _is_same(found: object, expected: object) -> bool:
    """Compare as a person would: 42 is 42.0, but true is not 1, and a third is not exact."""
    if isinstance(found, tuple) and isinstance(expected, tuple):
        return len(found) == len(expected) and all(map(_is_same, found, expected))
    if isinstance(found, bool) != isinstance(expected, bool):
        return False
    if isinstance(found, float) and isinstance(expected, (int, float)):
        return math.isclose(found, expected, rel_tol=_SINGLE, abs_tol=1e-12)
    return found == expected


def _difference(transport: str, wanted: bytes, found: bytes) -> str:
    """Return both sides in hex and text around the first byte at which they differ."""
    at = next((i for i, (a, b) in enumerate(zip(wanted, found, strict=False)) if a != b), None)
    offset = min(len(wanted), len(found)) if at is None else at
    start = max(0, offset - _BEFORE_BYTES) if max(len(wanted), len(found)) > _SHOWN_BYTES else 0
    sides = f"expected {_bytes_shown(wanted, start)}, found {_bytes_shown(found, start)}"
    return f"{transport}: at byte {offset}, {sides}"


def _bytes_shown(data: bytes, start: int) -> str:
    """Return what stands from `start`, with dots where something is left out."""
    if not data:
        return "nothing"
    part = data[start : start + _SHOWN_BYTES]
    before, after = "… " if start else "", " …" if start + len(part) < len(data) else ""
    text = part.decode("ascii", "backslashreplace")
    return f"{before}{text!r} ({part.hex(' ')}){after}"
