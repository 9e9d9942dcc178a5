"""No document makes one expression or one pattern take more than a moment, or more than its share.

Each bound is judged before the work is done, so no test here waits for it.
"""

import sys
from pathlib import Path

import pytest

from urc.expressions import ExpressionError, Template, compile_expression
from urc.patterns import PatternError, compile_pattern
from urc.problems import ProblemsError
from urc.runtime.open_profile import open_document

ATTACKS = Path(__file__).parents[1] / "attacks" / "drivers"
LONG = ",".join("x" * 32768)
"""64 KiB with 32,768 parts."""


@pytest.mark.parametrize("digits", [-10_000_000, -16, 16, 10**9])
def test_round_takes_as_many_digits_as_a_number_has(digits: int) -> None:
    rounded = compile_expression("x | round(n)")
    with pytest.raises(ExpressionError, match="'round' takes -15 to 15 digits"):
        rounded.evaluate({"x": 5, "n": digits})


@pytest.mark.parametrize(("digits", "value"), [(-15, 0), (-1, 120), (0, 123), (15, 123)])
def test_every_sensible_rounding_works(digits: int, value: int) -> None:
    assert compile_expression("x | round(n)").evaluate({"x": 123, "n": digits}) == value


@pytest.mark.parametrize(
    "expression", ["t | column(0, ',')", "t | cut(0)", "t | column(0, ',') | length"]
)
def test_cells_of_many_rows_are_counted(expression: str) -> None:
    """Three hundred names of one long text are short to write and ten million parts to cut."""
    with pytest.raises(ExpressionError, match="more than 65536 "):
        compile_expression(expression).evaluate({"t": [LONG] * 300})


def test_a_table_of_usual_size_is_cut() -> None:
    rows = ["1,2,3,4"] * 4096
    assert compile_expression("t | column(2, ',')").evaluate({"t": rows}) == ["3"] * 4096


TOO_LARGE = [
    "(?:a?){1000}" * 10 + "x",
    "(?:(?:a?){30}){30}",
    "(?P<n>(?:[ab]*a[ab]{600}[ab]{600}))c",
    r"(?:\W?){150}",
    "|".join(["é{60}"] * 10),
]


@pytest.mark.parametrize("is_installed", [True, False], ids=["with RE2", "without RE2"])
@pytest.mark.parametrize("source", TOO_LARGE)
def test_a_pattern_that_multiplies_is_refused(
    source: str, is_installed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same line with and without RE2: the pattern is judged as it is written."""
    if not is_installed:
        monkeypatch.setitem(sys.modules, "re2", None)
    with pytest.raises(PatternError, match=r"this pattern has \d+ parts, but the limit is 1000"):
        compile_pattern(source)


def test_a_sentence_of_a_usual_length_is_found_anywhere() -> None:
    """NMEA 0183 has up to 82 characters between its dollar sign and its line end."""
    assert compile_pattern(r"\$[^\r\n]{1,80}\r\n").search("xx$GPGLL,,V\r\n") == {}


@pytest.mark.parametrize("source", [r"^[0-9A-F]{1000}$", r"^.{800},(?P<n>\d+)$"])
def test_a_pattern_that_is_proven_may_count_far(source: str) -> None:
    """Its cost is that of the text, whatever the counts are."""
    assert compile_pattern(source).is_proven


def test_the_count_follows_the_program_that_re2_makes() -> None:
    """What is allowed stays small in RE2, too; without RE2 there is nothing to compare with."""
    import re2

    from urc._patterns import cost_of

    for source in [
        r"\w+,(?P<n>[^|>]+)\|",
        r"(?s)\$110=(?P<x>[^\s]+).*\$111=(?P<y>[^\s]+)",
        "(?:a?){100}b",
        r"(?:ab|cd|[^x]{3}){5}",
        "é€[à-ÿ]{4}",
    ]:
        real = re2.compile(source).programsize
        assert real / 2 <= cost_of(source) <= real * 2, source


def test_a_byte_counts_as_one_character() -> None:
    """A framing looks at bytes: a class of many is no larger than one of few."""
    sentence = r"\$[^\r\n]{1,80}\r\n"
    assert compile_pattern(sentence, is_over_bytes=True).source == sentence
    with pytest.raises(PatternError, match="this pattern has"):
        compile_pattern(r"\$[^\r\n]{1,800}\r\n", is_over_bytes=True)


def test_a_package_whose_pattern_costs_too_much_is_refused_when_it_is_read() -> None:
    with pytest.raises(ProblemsError, match="this pattern has"):
        open_document(ATTACKS / "pattern-bomb" / "driver.yaml")


def test_a_package_that_rounds_without_end_is_read_at_once() -> None:
    """Its command is rendered while it is read, and fails in words when it is given."""
    send = open_document(ATTACKS / "round-bomb" / "driver.yaml").driver.commands["beep"].send
    (template,) = (one for one in send.options.values() if isinstance(one, Template))
    with pytest.raises(ExpressionError, match="'round' takes"):
        template.render({})


def test_a_package_that_cuts_a_long_text_often_gives_no_value() -> None:
    read = open_document(ATTACKS / "column-bomb" / "driver.yaml").driver.messages["said"].read
    with pytest.raises(ExpressionError, match="more than 65536 parts"):
        read.sets["count"].evaluate({"names": LONG})
