"""The runner of a document's tests, which uses the same engine as a real robot.

Layer 4. The module uses neither I/O nor asyncio, so `urc validate` needs no robot, network or
secret.

A test runs either in a single instant or step by step on a simulated clock. In a test that runs in
a single instant, the driver sends only what the test requests. In a test with steps, the whole
driver runs, except polls that the test does not name.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from urc.model.driver import Driver
from urc.model.profile import DialogueStep, DocumentTest, Profile, Setting, pieces_of
from urc.model.values import Value
from urc.problems import Problem, UrcError
from urc.protocol.events import Failed
from urc.runtime.signal_hints import SignalHints
from urc.runtime.test_compare import check_bytes, check_reply, check_values, first
from urc.runtime.test_engine import Exercised, TestEngine

__all__ = ["TestReport", "exercise", "sample_settings"]

_SAMPLE: Final[Mapping[str, Value]] = {"host": "127.0.0.1", "port": 1, "integer": 0, "number": 0.0}
_ROUNDS: Final = 16
"""Maximum number of deadlines that a test handles while it waits for its declared failure."""


class TestReport(NamedTuple):
    """Results of a document's tests."""

    problems: list[Problem]
    """One problem for each failed test."""
    exercised: frozenset[Exercised]
    """Commands, polls and messages used by at least one test."""


class _Complaint(NamedTuple):
    text: str
    step: int | None = None
    """Index of the failed step, from 0; None if the test has no steps."""


def exercise(profile: Profile) -> TestReport:
    """Run every test of `profile`; return the failures and the used parts of the driver."""
    settings = sample_settings(profile.settings)
    problems = []
    used: set[Exercised] = set()
    for test in profile.tests:
        complaint = _run(profile.driver, {**settings, **test.settings}, test, used)
        if complaint.text:
            problems.append(_problem(profile, test, complaint))
    return TestReport(problems, frozenset(used))


def sample_settings(settings: Mapping[str, Setting]) -> dict[str, Value]:
    """Return a value for every setting: the default, or an example of the setting's type.

    Optional settings without a default stay empty.
    """
    values: dict[str, Value] = {}
    for name, setting in settings.items():
        if setting.default is not None:
            values[name] = setting.default
        elif not setting.is_required:
            values[name] = setting.empty
        elif setting.choices:
            values[name] = setting.choices[0]
        elif setting.type == "boolean":
            values[name] = False
        else:
            values[name] = _SAMPLE.get(setting.type, name)
    return values


def _problem(profile: Profile, test: DocumentTest, complaint: _Complaint) -> Problem:
    place: DocumentTest | DialogueStep = test
    what = f"test {test.name!r}"
    if complaint.step is not None:
        place = test.steps[complaint.step]
        what += f", step {complaint.step + 1}"
    return Problem(
        "test-failed",
        f"{what}: {complaint.text}",
        test.file or profile.file,
        line=place.line,
        column=place.column,
        path="tests",
        source=place.source,
    )


def _run(
    driver: Driver, settings: Mapping[str, Value], test: DocumentTest, used: set[Exercised]
) -> _Complaint:
    """Return the failure message, or "" if the test passes; add the used parts to `used`."""
    used |= _asked(driver, test)
    try:
        trial = TestEngine(_narrowed(driver, test), settings, driver.polls)
    except UrcError as error:
        return _Complaint(str(error))
    try:
        if test.steps:
            return _in_steps(trial, test)
        return _Complaint("; ".join(_in_an_instant(trial, test)))
    except UrcError as error:
        return _Complaint(str(error))
    finally:
        used |= trial.used


def _asked(driver: Driver, test: DocumentTest) -> set[Exercised]:
    """Return the requests that a one-instant test makes, even if it fails before they are sent."""
    asked: set[Exercised] = set()
    if isinstance(test.reply_to, int):
        poll = driver.polls[test.reply_to]
        asked.add(("poll", poll.name))
        if poll.run:
            asked.add(("command", poll.run))
    for command in (test.run, test.reply_to):
        if isinstance(command, str):
            asked.add(("command", command))
    return asked


def _narrowed(driver: Driver, test: DocumentTest) -> Driver:
    """Return a copy of the driver with only the polls that the test names.

    In a one-instant test, polls are due immediately. If a test makes no request, the driver keeps
    its connection steps and keepalives, because the test may check them.
    """
    if test.steps:
        polls = tuple(poll for poll in driver.polls if poll.name in test.polls)
        narrowed = driver._replace(polls=polls)
        if not test.is_ready:
            return narrowed
        return _isolated(narrowed, keeps_conditions=True)._replace(polls=polls)
    polls = (driver.polls[test.reply_to],) if isinstance(test.reply_to, int) else ()
    narrowed = driver._replace(polls=polls)
    if test.run is None and test.reply_to is None:
        return narrowed
    return _isolated(narrowed, keeps_conditions=test.fails is not None)


# -- in one instant


def _in_an_instant(trial: TestEngine, test: DocumentTest) -> list[str]:
    """Connect, send the request and pass the reply to the engine; return the failure messages."""
    command = test.run or (test.reply_to if isinstance(test.reply_to, str) else None)
    checks = bool(test.expect or test.sent or test.fails is not None)
    asked = trial.driver.commands.get(command or "")
    is_fed_only = bool(test.feed) and command is None and test.reply_to is None
    if not checks and not is_fed_only and (not test.feed or asked is None or asked.reply is None):
        return ["the test checks nothing; add 'expect', 'sent' or 'fails'"]
    trial.connect_lines()
    if command is not None:
        trial.run(command, test.arguments)
    for name, fed in test.feed.items():
        for piece in pieces_of(fed):
            trial.feed(name, piece)
    trial.fall_silent()
    if test.fails is None:
        complaints = first(trial.failures)
    else:
        complaints = _check_failure(trial, test.fails)
    complaints += check_values(trial, test.expect, SignalHints(trial, in_steps=False))
    complaints += check_bytes(trial, trial.driver, test.sent)
    if not checks and is_fed_only and not complaints and not trial.fresh and not trial.used:
        complaints.append(
            "no message or reply matches the data in 'feed'; is the end of the frame missing?"
        )
    if not checks and command is not None and not complaints:
        complaints += check_reply(trial.ended, {}, command)  # the command only has to complete
    return complaints


def _check_failure(trial: TestEngine, expected: str) -> list[str]:
    """Advance the time until the declared failure; return a message if no failure occurs."""
    for _ in range(_ROUNDS):
        if any(expected in failure for failure in trial.failures):
            return []
        if not trial.pass_to_deadline():
            break
    found = "; ".join(first(trial.failures)) or "nothing failed"
    return [f"it should fail with {expected!r}, but {found}"]


# -- step by step


def _in_steps(trial: TestEngine, test: DocumentTest) -> _Complaint:
    """Run the steps up to the first failure."""
    place = 0
    try:
        trial.connect_lines()
        trial.wait(0.0)
        for place, step in enumerate(test.steps):
            is_action = _is_action(step)
            if is_action and trial.failures:
                return _Complaint(_unexpected(trial), place - 1 if place else 0)
            if is_action:
                trial.forget()
                _act(trial, step)
            complaints = list(_check(trial, step))
            if complaints:
                return _Complaint("; ".join(complaints), place)
    except UrcError as error:
        return _Complaint(str(error), place)
    return _Complaint(_unexpected(trial) if trial.failures else "", place)


def _is_action(step: DialogueStep) -> bool:
    happens = (step.feed, step.run, step.connects, step.closes, step.leaves)
    return any(happens) or step.wait_s is not None


def _unexpected(trial: TestEngine) -> str:
    return f"{'; '.join(first(trial.failures))} (if this is intended, add 'fails')"


def _act(trial: TestEngine, step: DialogueStep) -> None:
    if step.connects:
        trial.connect(step.connects)
    if step.closes:
        trial.close(step.closes)
    if step.leaves:
        trial.leave()
    if step.run:
        trial.run(step.run, step.arguments)
    for name, fed in step.feed.items():
        for piece in pieces_of(fed):
            if not trial.engine.lines[name].is_open:
                raise UrcError(f"{name} is not connected: it cannot receive the data in 'feed'")
            trial.feed(name, piece)
    trial.wait(step.wait_s or 0.0)


def _check(trial: TestEngine, step: DialogueStep) -> list[str]:
    """Check one step's expectations, and return a message for each failure."""
    complaints: list[str] = []
    if step.fails:
        complaints += _check_told(trial, step)
    if step.reply is not None:
        failed = [text for text in trial.failures if not step.fails]
        complaints += first(failed)
        complaints += check_reply(trial.ended, step.reply, step.of)
    complaints += check_bytes(trial, trial.driver, step.sent)
    values = list(check_values(trial, step.expect, SignalHints(trial, in_steps=True)))
    if values and trial.failures and step.reply is None:
        complaints += first(trial.failures)
    complaints += values
    if step.closed:
        if step.closed in trial.closed:
            trial.closed.discard(step.closed)
        else:
            complaints.append(f"URC should have closed {step.closed}, but it is open")
    return complaints


def _check_told(trial: TestEngine, step: DialogueStep) -> list[str]:
    """Report a missing declared failure and discard the step's other events."""
    failures = list(trial.failures)
    if step.of:
        ended = [one for one in trial.ended if one.command == step.of]
        failures = [f"{one.code}: {one.message}" for one in ended if isinstance(one, Failed)]
    if not any(step.fails in failure for failure in failures):
        found = "; ".join(first(failures)) or "nothing failed"
        return [f"it should fail with {step.fails!r}, but {found}"]
    trial.failures.clear()
    trial.ended[:] = [one for one in trial.ended if not isinstance(one, Failed)]
    return []


def _isolated(driver: Driver, *, keeps_conditions: bool) -> Driver:
    """Return a copy of the driver without connection steps, keepalives and ``stale_after``.

    Args:
        driver: the loaded driver.
        keeps_conditions: whether to keep the `requires` and `verify` conditions of commands. Byte
            tests omit the conditions, because no robot reports the required signals.
    """
    transports = {
        name: spec._replace(on_connect=(), on_close=(), keepalive=None, stale_after_s=None)
        for name, spec in driver.transports.items()
    }
    commands = driver.commands
    if not keeps_conditions:
        commands = {
            name: command._replace(requires=(), verify=None) for name, command in commands.items()
        }
    polls = tuple(poll._replace(phase_s=0.0, when=None) for poll in driver.polls)
    return driver._replace(transports=transports, commands=commands, polls=polls)
