"""Templates: what they give, what they refuse, and that Jinja agrees where both answer."""

from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jinja2 import StrictUndefined, TemplateError, nodes
from jinja2.compiler import CodeGenerator, Frame
from jinja2.sandbox import SandboxedEnvironment

from tests.effort import examples
from urc.expressions import (
    COUNTERS,
    ExpressionError,
    compile_expression,
    compile_template,
    text_of,
)

NAMESPACE = {
    "row": [3, 1, 2],
    "x": 7,
    "y": 2.5,
    "word": "Go",
    "settings": {"host": "10.0.0.5", "port": 6789},
}


class _Compiler(CodeGenerator):
    """Spells the operands of ``~`` as URC does: 20 and true, where Jinja says 20.0 and True."""

    def visit_Concat(self, node: nodes.Concat, frame: Frame) -> None:  # noqa: N802  # Jinja's name
        self.write("''.join(environment.spelt(one) for one in (")
        for inner in node.nodes:
            self.visit(inner, frame)
            self.write(", ")
        self.write("))")


class Oracle(SandboxedEnvironment):
    """Jinja's own sandbox, which folds no constants: they would be spelt before they get here."""

    code_generator_class = _Compiler
    spelt = staticmethod(text_of)

    def __init__(self) -> None:
        super().__init__(undefined=StrictUndefined, optimized=False)


ORACLE = Oracle()


SAME_AS_JINJA = [
    "x + 1",
    "x - 1",
    "x * 2 + 1",
    "x / 2",
    "x // 2",
    "x % 4",
    "2 ** 10",
    "-x",
    "+x",
    "(x | float) / 2",
    "y | round(1)",
    "x | abs",
    "word | upper",
    "word | lower ~ x",
    "'  a ' | trim",
    "word | replace('G', 'N')",
    "word | length",
    "x > 3 and y < 3",
    "x > 3 or nothing",
    "not x",
    "3 < x < 9",
    "'o' in word",
    "x not in [1, 2]",
    "'big' if x > 5 else 'small'",
    "missing is defined",
    "x is defined",
    "x is odd",
    "x is even",
    "x is none",
    "missing | default(5)",
    "settings.port + 1",
    "settings['host']",
    "[1, 2, 3][1]",
    "true",
    "none is none",
    "1 is none",
    "'a' is not none",
    "1 if x else 2",
    "-x | abs",
    "2 ** -1",
    "2 ** 3 ** 2",
    "10 - 4 - 3",
    "7 % 4 * 2",
    "1 ~ 2 * 3 ~ 4",
    "not x > 3",
    "not not x",
    "x is not none",
    "x is not odd",
    "1 < x",
    "0x1F + 0b11",
    "'it\\'s' ~ \"\\n\"",
    "1.5e3",
    "1 if false else 2 if false else 3",
    "row[1:]",
    "row[:-1]",
    "row[:]",
    "word[0:1]",
    "row[-2:x]",
    "row | join(',')",
    "row[:2] | join",
    "row | min",
    "row | max",
    "row | sum",
    "row | first",
    "row | last",
    "word | last",
    "[] | sum",
    "x is in row",
    "x is not in row",
    "x is number and word is string",
]


@pytest.mark.parametrize("source", SAME_AS_JINJA)
def test_an_expression_gives_what_jinja_gives(source: str) -> None:
    """The oracle is Jinja's own sandbox."""
    environment = SandboxedEnvironment(undefined=StrictUndefined)
    expected = environment.compile_expression(source, undefined_to_none=False)(**NAMESPACE)
    assert compile_expression(source).evaluate(NAMESPACE) == expected


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("{{ settings.port }}", 6789),
        ("{{ x }}", 7),
        ("{{ x > 3 }}", True),
        ("v={{ x }}", "v=7"),
        ("{{ x }}{{ y }}", "72.5"),
        ("", ""),
        ("plain", "plain"),
        ("A\rB\r\nC\n", "A\rB\r\nC\n"),
        ("{ x } }}", "{ x } }}"),
        ("{{ '}}' ~ x }}", "}}7"),
        ("{{ none }}", None),
        ("a{{ none }}b", "ab"),
        ("{{ x | hex(4) }}", "0007"),
        ("{{ y | fixed(3) }}", "2.500"),
        ("{{ x | pad(3) }}", "007"),
        ("{{ x | sign }}", "+7"),
        ("{{ -x | sign }}", "-7"),
        ("{{ 0 | sign }}", "+0"),
        ("{{ 20.0 | sign }}", "+20"),
        ("{{ y | fixed(2) | sign }}", "+2.50"),
        ("{{ -y | fixed(2) | sign }}", "-2.50"),
    ],
)
def test_a_template_of_one_expression_keeps_its_type(source: str, expected: object) -> None:
    """Literal text stays as it is, to the byte: Jinja itself would fold CR and drop the last LF."""
    value = compile_template(source).evaluate(NAMESPACE)
    assert value == expected
    assert type(value) is type(expected)


@pytest.mark.parametrize(
    ("source", "offset", "words"),
    [
        ("a {{ b", 2, "never closed"),
        ("{% for x in y %}", 0, "no statements"),
        ("{# note #}", 0, "no comments"),
        ("a {{ b c }}", 7, "'c' is not expected here"),
        ("{{ x | nope }}", 7, "no filter 'nope'"),
        ("{{ x | hex(1, 2) }}", 7, "takes 0 to 1 arguments"),
        ("{{ x() }}", 4, "function calls are not supported"),
        ("{{ word[0:1:2] }}", 11, "a start and an end, but no step"),
        ("{{ x : 1 }}", 5, "':' is not expected here"),
        ("{{ word is match(x) }}", 17, "a pattern in quotes"),
        ("{{ word is match }}", 16, "'(' is expected"),
        ("{{ word is search('a(') }}", 18, "invalid pattern"),
        ("{{ word is match('(?=a)') }}", 17, "look-ahead"),
        ("{{ 1 if x }}", 9, "needs an 'else'"),
        ("{{ x is divisibleby 3 }}", 8, "no test 'divisibleby'"),
        ("{{ }}", 2, "ends too early"),
        ("{{ x + }}", 6, "ends too early"),
        ("{{ (x }}", 5, "')' is expected"),
        ("{{ [1, 2 }}", 8, "',' is expected"),
        ("{{ x. }}", 5, "a name is expected after the dot"),
        ("{{ x and }}", 8, "ends too early"),
        ("{{ x; y }}", 4, "';' is not allowed in an expression"),
        ("{{ 010 }}", 3, "'010' is not a number"),
        ("{{ 1e999 }}", 3, "too large"),
        (r"{{ 'a\d' }}", 5, "not a valid escape"),
        ("{{ 'a }}", 0, "never closed"),
        ("{{" + "(" * 500 + "1" + ")" * 500 + "}}", 22, "too deeply"),
        ("{{ " + "-" * 500 + "1 }}", 42, "too deeply"),
        ("{{ " + "1+" * 500 + "1 }}", 84, "too long"),
        ("x" * 5000, 0, "at most 4096"),
    ],
)
def test_a_fault_in_a_template_is_found_when_it_is_compiled(
    source: str, offset: int, words: str
) -> None:
    """The offset leads to the character in the document."""
    with pytest.raises(ExpressionError) as caught:
        compile_template(source)
    assert words in str(caught.value)
    assert caught.value.offset == offset


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("missing", "'missing' has no value here"),
        ("settings.nope", "'nope' has no value here"),
        ("'a' * 100000000", "expected a number"),
        ("2 ** 99999", "too large"),
        ("x / 0", "division by zero"),
        ("'abc' | int", "expected a whole number"),
        ("x.__class__", "no key '__class__'"),
        ("word.upper", "no key 'upper'"),
        ("word > 3", "not supported"),
        ("word | replace('', 'x')", "needs text to search for"),
        ("x[0:1]", "expected text, a list or bytes, found"),
        ("row['a':]", "expected a whole number as index"),
        ("word | join", "expected a list"),
        ("[] | max", "an empty list has no minimum or maximum"),
        ("[] | first", "is empty"),
        ("['a'] | sum", "expected a list of numbers"),
        ("word | split('')", "needs a separator"),
        ("x is match('a')", "expected text"),
        ("4807 | ddmm('Q')", "expected N, S, E or W"),
        ("4867 | ddmm", "expected degrees and minutes"),
        ("'x' | sign", "expected a number"),
        ("'' | sign", "expected a number"),
        ("'x' | ddmm", "expected degrees and minutes"),
    ],
)
def test_a_wrong_operand_is_one_clear_line(source: str, words: str) -> None:
    """Jinja would answer some of these with 0 or a Python attribute."""
    with pytest.raises(ExpressionError, match=words.replace("'", ".")):
        compile_expression(source).evaluate(NAMESPACE)


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("'4807.038' | ddmm('N')", 48.1173),
        ("'14718.5084' | ddmm('W')", -147.30847333333333),
        ("'' | ddmm('N')", None),
        ("none | ddmm", None),
        ("'a,b,,c' | split(',')", ["a", "b", "", "c"]),
        ("' a  b ' | split", ["a", "b"]),
        ("'OK 12' is match('OK')", True),
        ("'an OK' is match('OK')", False),
        ("'an OK' is search('OK$')", True),
        ("'12' is match('[0-9]+$') and '1x' is not match('[0-9]+$')", True),
        (r"'a1' is search('\d')", True),
        ("'OK' is match('NO|OK')", True),
        ("('1 2 3' | split)[1:] | join('+')", "2+3"),
    ],
)
def test_rows_and_patterns_are_taken_apart(source: str, expected: object) -> None:
    """What Jinja has not, or has otherwise."""
    assert compile_expression(source).evaluate(NAMESPACE) == expected


def test_the_names_that_a_template_uses_are_known() -> None:
    """The loader checks them before anything is connected."""
    template = compile_template("{{ settings.host }}:{{ x + settings['port'] }}")
    assert template.names == {"settings", "x"}
    assert template.settings == {"host", "port"}
    assert not template.is_constant
    assert compile_template("ping").is_constant


@given(st.text(max_size=200))
def test_any_text_compiles_or_is_refused_in_words(text: str) -> None:
    """Nothing but ExpressionError leaves, at compile time or later."""
    for compiler in (compile_template, compile_expression):
        with suppress(ExpressionError):
            compiler(text).evaluate(NAMESPACE)


ATOMS = st.sampled_from(
    ["1", "2.5", "20.0", "x", "y", "settings.port", "'a'", "'20'", "true", "[1, 2]"]
)
OPERATORS = ["+", "-", "*", "/", "//", "%", "~", "and", "or", "==", "<", ">=", "in", "not in"]


def deeper(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    """Expressions made of smaller ones."""
    return st.one_of(
        st.tuples(inner, st.sampled_from(OPERATORS), inner).map(" ".join),
        inner.map("({})".format),
        inner.map("-{}".format),
        inner.map("not {}".format),
        inner.map("{} | abs".format),
        inner.map("{} is none".format),
        st.tuples(inner, inner, inner).map(lambda parts: "{} if {} else {}".format(*parts)),
    )


@settings(max_examples=examples(2400))
@given(st.recursive(ATOMS, deeper, max_leaves=8))
def test_whatever_both_can_say_means_the_same_as_in_jinja(source: str) -> None:
    """Precedence and association are Jinja's; where URC complains, it may be stricter."""
    try:
        found = compile_expression(source).evaluate(NAMESPACE)
    except ExpressionError:
        return
    try:
        expected = ORACLE.compile_expression(source, undefined_to_none=False)(**NAMESPACE)
    except TemplateError:
        assert "is none" in source  # it chains no tests
        return
    assert found == expected


def test_a_counter_is_the_only_call() -> None:
    """Its numbers come from the namespace; what it may be is known when it is compiled."""
    asked = []

    def draw(name: str, low: int, high: int) -> int:
        asked.append((name, low, high))
        return 7

    template = compile_template("{{ seq('id', 0, 0xFF) | pad(3) }}/{{ seq }}")
    assert template.names == {COUNTERS, "seq"}
    assert template.evaluate({COUNTERS: draw, "seq": 1}) == "007/1"
    assert asked == [("id", 0, 255)]


@pytest.mark.parametrize(
    ("text", "offset"),
    [
        ("seq()", 4),
        ("seq(id, 0, 9)", 4),
        ("seq('Id', 0, 9)", 4),
        ("seq('id')", 0),
        ("seq('id', 0)", 0),
        ("seq('id', 0, x)", 0),
        ("seq('id', 9, 9)", 0),
        ("seq('id', 0, 9, 1)", 0),
        ("seq('id', -1, 9)", 0),
    ],
)
def test_a_counter_that_cannot_count_is_refused(text: str, offset: int) -> None:
    """At the place of the fault."""
    with pytest.raises(ExpressionError) as caught:
        compile_expression(text)
    assert caught.value.offset == offset
