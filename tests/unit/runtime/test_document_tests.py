"""The documents' own tests: each kind passes when it should, and says what is wrong when not."""

import pytest

from urc.model.driver import Command, FramingSpec, Reply
from urc.model.exchange import Hold
from urc.model.profile import DocumentTest, Profile, Setting
from urc.model.values import Signal
from urc.patterns import compile_pattern
from urc.problems import Problem
from urc.runtime.document_tests import exercise, sample_settings
from urc.runtime.test_compare import is_same
from urc.testing.profile import line_profile, regex, text

ASKED = "Give me the battery %"


def robot(*, is_per_request: bool = False) -> Profile:
    """Return a robot with polls, commands with and without a reply, and a message."""
    profile = line_profile(is_per_request=is_per_request)
    reply = Reply(regex("^ok$"), errors=(compile_pattern(r"^ERR \d+$"),), timeout_s=0.5)
    stop = Command("stop", "wire", text("stop"), reply=reply)
    poll = profile.driver.polls[0]
    return profile._replace(
        driver=profile.driver._replace(
            commands={**profile.driver.commands, "stop": stop},
            polls=(poll, poll._replace(name="slow", phase_s=7.0)),
        )
    )


def complaint(test: DocumentTest, profile: Profile | None = None) -> str:
    """Run one test; return what is said about it, or "" when it passes."""
    problems = exercise((profile or robot())._replace(tests=(test,))).problems
    if not problems:
        return ""
    (problem,) = problems
    name, _, message = problem.message.partition("test 'it works': ")
    assert name == ""
    return message


def trial(**keys: object) -> DocumentTest:
    return DocumentTest("it works", 7, **keys)  # type: ignore[arg-type]


@pytest.mark.parametrize("is_per_request", [False, True])
@pytest.mark.parametrize(
    "test",
    [
        trial(feed={"wire": "42\n"}, reply_to=0, expect={"battery": 42}),
        trial(feed={"wire": "42\n"}, reply_to=1, expect={"battery": 42.0}),
        trial(feed={"wire": "42\n"}, reply_to="ask", expect={"battery": 42}),
        trial(feed={"wire": "42\n"}, run="ask", expect={"battery": 42}, sent={"wire": ASKED}),
        trial(run="say", arguments={"word": "hello"}, sent={"wire": "say hello"}),
        trial(run="say", arguments={"word": "a\nb"}, fails="bad-argument: word:"),
        trial(feed={"wire": "ERR 7\n"}, run="stop", fails="refused: the robot answered 'ERR 7'"),
        trial(run="stop", fails="timed-out"),
        trial(run="stop", fails="within 0.5 s", sent={"wire": "stop"}),
        trial(feed={"wire": "none\n"}, reply_to=0, fails="no-match"),
        trial(feed={"wire": "x\n"}, run="stop", fails=""),
        trial(feed={"wire": "ok\n"}, run="stop"),
    ],
    ids=lambda test: f"{test.run or test.reply_to}-{test.fails}",
)
def test_test_that_holds_passes(test: DocumentTest, is_per_request: bool) -> None:
    """Polls (late ones too), commands, replies, bytes and failures, however the line is made."""
    assert complaint(test, robot(is_per_request=is_per_request)) == ""


@pytest.mark.parametrize(
    "test",
    [
        trial(feed={"wire": b"42\n"}, reply_to=0, expect={"battery": 42}),
        trial(feed={"wire": ("4", b"2", "\n")}, reply_to=0, expect={"battery": 42}),
        trial(run="say", arguments={"word": "hi"}, sent={"wire": b"say hi\n"}),
        trial(feed={"wire": "33\n"}, reply_to=0, expect={"battery": 33 + 1e-7}),
    ],
    ids=["bytes", "pieces", "sent", "nearly"],
)
def test_bytes_are_those_on_the_wire(test: DocumentTest) -> None:
    """What the framing adds is among them; text is what the framing goes around."""
    profile = robot()
    signals = {**profile.driver.signals, "battery": Signal("battery", "number")}
    profile = profile._replace(driver=profile.driver._replace(signals=signals))
    assert complaint(test, profile) == ""


@pytest.mark.parametrize(
    ("found", "expected", "same"),
    [
        (0.10000000149011612, 0.1, True),
        (0.1000001, 0.1, False),
        (1, 1.0, True),
        (16777217, 16777216, False),
        (True, 1, False),
        ((1.5, 2), (1.5, 2.0), True),
        ((1.5, 2), (1.5, 3), False),
        ((1.5,), (1.5, 2), False),
        ((1.5,), 1.5, False),
        (None, None, True),
        (0.0, None, False),
    ],
)
def test_numbers_are_the_same_to_seven_digits(found: object, expected: object, same: bool) -> None:
    """As many as a number of four bytes has; whole numbers exactly, lists element by element."""
    assert is_same(found, expected) is same


def test_settings_of_a_test_take_the_place_of_the_defaults() -> None:
    """They hold for this test alone."""
    profile = robot()
    ask = profile.driver.commands["ask"]._replace(send=text("ask {{ settings.unit }}"))
    driver = profile.driver._replace(commands={"ask": ask})
    profile = profile._replace(
        driver=driver, settings={"unit": Setting("unit", "integer", default=1)}
    )
    assert complaint(trial(run="ask", sent={"wire": "ask 1"}), profile) == ""
    own = trial(run="ask", sent={"wire": "ask 7"}, settings={"unit": 7})
    assert complaint(own, profile) == ""


def test_message_that_nobody_asked_for_is_read() -> None:
    """A line that stays open takes what the robot says by itself."""
    assert complaint(trial(feed={"wire": "note hi\n"}, expect={"note": "hi"})) == ""


def test_a_test_that_only_feeds_holds_when_all_is_read() -> None:
    """What nothing declared reads is a fault, and so is a frame that never ends."""
    assert complaint(trial(feed={"wire": "note hi\n"})) == ""


@pytest.mark.parametrize(
    ("test", "message"),
    [
        (trial(feed={"wire": "nota hi\n"}), "no-match: no declaration matches 'nota hi'"),
        (
            trial(feed={"wire": "note hi"}),
            "no message or reply matches the data in 'feed'; is the end of the frame missing?",
        ),
        (
            trial(feed={"wire": "42\n"}, reply_to=0),
            "the test checks nothing; add 'expect', 'sent' or 'fails'",
        ),
        (
            trial(feed={"wire": "ok"}, run="stop"),
            "stop should have ended, but no reply arrived or no command was run",
        ),
        (trial(feed={"wire": "no\n"}, run="stop"), "no-match: no declaration matches 'no'"),
        (
            trial(feed={"wire": "ok\n"}, run="say", arguments={"word": "x"}),
            "the test checks nothing; add 'expect', 'sent' or 'fails'",
        ),
        (
            trial(feed={"wire": "43\n"}, reply_to=0, expect={"battery": 42}),
            "battery: expected 42, found 43",
        ),
        (
            trial(feed={"wire": "1\n"}, reply_to=0, expect={"battery": True}),
            "battery: expected true, found 1",
        ),
        (
            trial(feed={"wire": "42\n"}, reply_to=0, expect={"note": "x"}),
            "note: expected 'x', but nothing set it: the data in 'feed' set battery",
        ),
        (
            trial(feed={"wire": "4"}, reply_to=0, expect={"battery": 4}),
            "battery: expected 4, but nothing set it:"
            " '4' waits for the delimiter b'\\n' (write the delimiter in double quotes)",
        ),
        (
            trial(feed={"wire": "full\n"}, reply_to=0, expect={"battery": 100}),
            "no-match: no declaration matches 'full';"
            " battery: expected 100, but nothing set it:"
            " 'full' does not match the 'regex' of polls.0, which was sent",
        ),
        (
            trial(feed={"wire": "a\n" * 5}, reply_to=0, expect={"battery": 1}),
            "no-match: no declaration matches 'a'; no-match: no declaration matches 'a';"
            " no-match: no declaration matches 'a'; and 2 more;"
            " battery: expected 1, but nothing set it:"
            " 'a' does not match the 'regex' of polls.0, which was sent",
        ),
        (
            trial(feed={"wire": "ok\n"}, run="stop", fails="refused"),
            "it should fail with 'refused', but nothing failed",
        ),
        (
            trial(run="stop", fails="refused"),
            "it should fail with 'refused', but"
            " reply-timeout: no answer to stop within 0.5 s;"
            " timed-out: no answer to stop within 0.5 s",
        ),
        (
            trial(run="stop", fails="timed-out", expect={"battery": 1}, sent={"wire": "halt"}),
            "battery: expected 1, but nothing set it: nothing was fed; wire: at byte 0,"
            " expected 'halt\\n' (68 61 6c 74 0a), found 'stop\\n' (73 74 6f 70 0a)",
        ),
        (
            trial(run="say", arguments={"word": "hi"}, sent={"wire": "say ho"}),
            "wire: at byte 5,"
            " expected 'say ho\\n' (73 61 79 20 68 6f 0a),"
            " found 'say hi\\n' (73 61 79 20 68 69 0a)",
        ),
        (
            trial(feed={"wire": "note x\n"}, sent={"wire": "say"}),
            "wire: at byte 0, expected 'say\\n' (73 61 79 0a), found nothing",
        ),
        (
            trial(run="say", arguments={"word": "é"}, sent={"wire": "say"}),
            "wire: at byte 3, expected 'say\\n' (73 61 79 0a),"
            r" found 'say \\xc3\\xa9\n' (73 61 79 20 c3 a9 0a)",
        ),
        (
            trial(run="say", arguments={"word": "hi"}, sent={"wire": "say\nhi"}),
            r"wire: b'say\nhi' contains the delimiter b'\n', so it would be sent as two frames",
        ),
        (trial(run="say", sent={"wire": "x"}), None),
    ],
)  # fmt: skip
def test_test_that_does_not_hold_is_told(test: DocumentTest, message: str | None) -> None:
    """The whole message: what was expected, and what was found."""
    if message is None:
        message = (
            "bad-argument: say needs the argument 'word';"
            " wire: at byte 0, expected 'x\\n' (78 0a), found nothing"
        )
    assert complaint(test) == message


def test_difference_in_a_long_frame_is_shown_around_its_place() -> None:
    """The bytes before and after it, not the first ones of the frame."""
    test = trial(
        run="say",
        arguments={"word": "a" * 100 + "b" + "c" * 100},
        sent={"wire": "say " + "a" * 100 + "x" + "c" * 100},
    )
    after = "c" * 31
    hexed = " ".join(["61"] * 16)
    tail = " ".join(["63"] * 31)
    assert complaint(test) == (
        f"wire: at byte 104, expected … '{'a' * 16}x{after}' ({hexed} 78 {tail}) …,"
        f" found … '{'a' * 16}b{after}' ({hexed} 62 {tail}) …"
    )


@pytest.mark.parametrize(
    ("test", "message"),
    [
        (trial(feed={"wire": "é\n"}, expect={"note": ""}), "wire: 'é' cannot be encoded in ascii"),
        (trial(run="ask", sent={"wire": "é"}), "wire: 'é' cannot be encoded in ascii"),
    ],
)  # fmt: skip
def test_text_that_the_line_cannot_carry_is_told(test: DocumentTest, message: str) -> None:
    """A test's own mistake is a finding, too."""
    profile = robot()
    wire = profile.driver.transports["wire"]._replace(encoding="ascii")
    profile = profile._replace(driver=profile.driver._replace(transports={"wire": wire}))
    assert complaint(test, profile) == message


def test_driver_that_cannot_be_built_fails_its_tests() -> None:
    """A constant frame that holds its own delimiter is told, not raised."""
    profile = robot()
    wire = profile.driver.transports["wire"]._replace(
        framing=FramingSpec("delimiter", {"tx": b" ", "rx": b"\n"})
    )
    profile = profile._replace(driver=profile.driver._replace(transports={"wire": wire}))
    assert "delimiter" in complaint(trial(run="ask", sent={"wire": "x"}), profile)


def test_finding_stands_where_the_test_stands() -> None:
    """Its own file, line and column, with the text of the line."""
    failing = trial(
        feed={"wire": "1\n"}, reply_to=0, expect={"battery": 2},
        file="drivers/d.yaml", column=5, source="  - { name: it works }",
    )  # fmt: skip
    passing = trial(feed={"wire": "1\n"}, reply_to=0, expect={"battery": 1})
    profile = robot()._replace(tests=(passing, failing, failing._replace(file="")))
    first = Problem(
        "test-failed",
        "test 'it works': battery: expected 2, found 1",
        "drivers/d.yaml",
        line=7,
        column=5,
        path="tests",
        source="  - { name: it works }",
    )
    assert exercise(profile).problems == [first, first._replace(file="liner.yaml")]


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        (Setting("s", "string", default="x"), "x"),
        (Setting("s", "string"), "s"),
        (Setting("s", "path"), "s"),
        (Setting("s", "host"), "127.0.0.1"),
        (Setting("s", "port"), 1),
        (Setting("s", "integer"), 0),
        (Setting("s", "number"), 0.0),
        (Setting("s", "boolean"), False),
        (Setting("s", "boolean", default=False), False),
        (Setting("s", "choice", choices=("a", "b")), "a"),
    ],
)
def test_every_setting_gets_a_sample(setting: Setting, value: object) -> None:
    """Tests need no secret and no address: defaults, or something of the type."""
    found = sample_settings({"s": setting})["s"]
    assert (found, type(found)) == (value, type(value))


@pytest.mark.parametrize(
    ("test", "says"),
    [
        (trial(run="drive", sent={"wire": "drive"}), ""),
        (trial(run="drive", feed={"wire": "ok\n"}), ""),
        (trial(run="drive", feed={"wire": "ERR 7\n"}, fails="refused: the robot answered"), ""),
        (trial(run="drive", feed={"wire": "hm\n"}), "no-match"),
        (trial(run="drive", fails="timed-out"), "nothing failed"),
    ],
    ids=["given", "taken", "refused", "unknown words", "nobody waits"],
)
def test_a_held_command_is_given_as_the_wire_gives_it(test: DocumentTest, says: str) -> None:
    """No answer is owed, an acknowledgement is taken, and a refusal ends it."""
    profile = robot()
    held = profile.driver.commands["stop"]._replace(
        name="drive", send=text("drive"), hold=Hold(0.05)
    )
    driver = profile.driver._replace(commands={**profile.driver.commands, "drive": held})
    found = complaint(test, profile._replace(driver=driver))
    assert says in found
    assert bool(found) == bool(says)
