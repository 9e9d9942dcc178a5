"""Runs the tests that a document carries, on the same engine that drives the robot.

Floor 4, no I/O and no asyncio: `urc validate` runs these without a robot, a network or a secret.
"""

from collections.abc import Mapping

from urc.model.driver import Driver
from urc.model.profile import DocumentTest, Profile, Setting
from urc.model.values import Value
from urc.problems import Problem, UrcError
from urc.protocol.engine import Engine
from urc.protocol.events import Event, Failed, Fault, Open, Request, Samples, Send
from urc.protocol.framing import build_framing

__all__ = ["run_tests", "sample_settings"]

_SAMPLE: dict[str, Value] = {"host": "127.0.0.1", "port": 1, "integer": 0, "number": 0.0}
_ROUNDS = 16
"""How many deadlines a test lets pass while it waits for the failure that it declares."""


def run_tests(profile: Profile) -> list[Problem]:
    """Run every test of `profile`; return a finding for each one that fails."""
    settings = sample_settings(profile.settings)
    problems = []
    for test in profile.tests:
        complaint = _run(profile.driver, settings, test)
        if complaint:
            problems.append(_problem(profile, test, complaint))
    return problems


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
        self.samples: dict[str, Value] = {}
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


def _run(driver: Driver, settings: Mapping[str, Value], test: DocumentTest) -> str:
    """Return what is wrong, or "" when the test passes."""
    if not (test.expect or test.sent or test.fails):
        return "it checks nothing; say what it should 'expect', what is 'sent' or how it 'fails'"
    try:
        trial = _Trial(Engine(_narrowed(driver, test), settings))
    except UrcError as error:
        return str(error)
    trial.perform(trial.engine.tick(0.0), 0.0)
    for name, spec in driver.transports.items():
        if spec.connection == "persistent":
            trial.perform(trial.engine.start(name, 0.0), 0.0)
    command = test.run or (test.reply_to if isinstance(test.reply_to, str) else None)
    if command is not None:
        trial.perform(trial.engine.command(Request(1, command, test.arguments), 0.0), 0.0)
    for name, text in test.feed.items():
        data = text.encode(driver.transports[name].encoding)
        trial.perform(trial.engine.receive(name, data, 0.0), 0.0)
    if test.fails is not None:
        return _check_failure(trial, test.fails)
    return _check(driver, trial, test)


def _narrowed(driver: Driver, test: DocumentTest) -> Driver:
    """Return the driver with only the poll that the test is about, so that no other one speaks."""
    polls = (driver.polls[test.reply_to],) if isinstance(test.reply_to, int) else ()
    return driver._replace(polls=polls)


def _check_failure(trial: _Trial, expected: str) -> str:
    for _ in range(_ROUNDS):
        if any(expected in failure for failure in trial.failures):
            return ""
        deadline = trial.engine.deadline
        if deadline is None:
            break
        trial.perform(trial.engine.tick(deadline), deadline)
    found = "; ".join(trial.failures) or "nothing failed"
    return f"it should fail with {expected!r}, but {found}"


def _check(driver: Driver, trial: _Trial, test: DocumentTest) -> str:
    complaints = list(trial.failures)
    for name, expected in test.expect.items():
        if name not in trial.samples:
            complaints.append(f"{name}: expected {expected!r}, but nothing set it")
        elif not _is_same(trial.samples[name], expected):
            complaints.append(f"{name}: expected {expected!r}, found {trial.samples[name]!r}")
    for name, text in test.sent.items():
        spec = driver.transports[name]
        try:
            wanted = build_framing(spec.framing).encode(text.encode(spec.encoding))
        except (UrcError, UnicodeEncodeError) as error:
            complaints.append(f"{name}: {error}")
            continue
        found = trial.sent.get(name, b"")
        if found != wanted:
            complaints.append(_difference(name, wanted, found))
    return "; ".join(complaints)


def _is_same(found: Value, expected: Value) -> bool:
    """Compare as a person would: 42 is 42.0, but true is not 1."""
    return found == expected and isinstance(found, bool) == isinstance(expected, bool)


def _difference(transport: str, wanted: bytes, found: bytes) -> str:
    """Return both sides in hex and text, and the first offset at which they differ."""
    at = next((i for i, (a, b) in enumerate(zip(wanted, found, strict=False)) if a != b), None)
    offset = min(len(wanted), len(found)) if at is None else at
    return f"{transport}: at byte {offset}, expected {_shown(wanted)}, found {_shown(found)}"


def _shown(data: bytes) -> str:
    text = data[:48].decode("ascii", "backslashreplace")
    return f"{text!r} ({data[:48].hex(' ')}{' …' if len(data) > 48 else ''})" if data else "nothing"
