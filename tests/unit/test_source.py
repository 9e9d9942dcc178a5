"""Text → document: YAML 1.2's scalars, places of keys and values, and every way to be refused."""

import math
import os
from pathlib import Path

import pytest
import yaml

from urc.problems import Problem, ProblemsError, to_text
from urc.source import parse_document, read_document


def data_of(text: str) -> object:
    return parse_document(text, "f.yaml").data


def refused(text: bytes | str) -> Problem:
    """Return the only finding about a text that is refused."""
    with pytest.raises(ProblemsError) as caught:
        parse_document(text, "f.yaml")
    (problem,) = caught.value.problems
    return problem


def refused_file(path: Path | str) -> Problem:
    with pytest.raises(ProblemsError) as caught:
        read_document(str(path))
    (problem,) = caught.value.problems
    assert (problem.line, problem.column) == (1, 1)
    return problem


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("yes", "yes"), ("no", "no"), ("on", "on"), ("off", "off"), ("y", "y"),
        ("true", True), ("True", True), ("FALSE", False), ("tRue", "tRue"),
        ("null", None), ("~", None), ("", None), ("NULL", None), ("nil", "nil"),
        ("010", 10), ("0o17", 15), ("0x0D", 13), ("-7", -7), ("+7", 7), ("0o8", "0o8"),
        ("1_000", "1_000"), ("12:30:00", "12:30:00"), ("1:30", "1:30"),
        ("1e3", 1000.0), ("1.", 1.0), (".5", 0.5), ("-1.5e-3", -0.0015), ("1.2.3", "1.2.3"),
        (".inf", math.inf), ("-.INF", -math.inf), ("1e", "1e"), (".", "."), ("-", None),
        ("2026-01-01", "2026-01-01"), ("0b101", "0b101"), ("'1'", "1"), ('"true"', "true"),
        ("!!str 12", "12"), ("!!int 12", 12), ("!!float 1", 1), ("! 12", "12"), ("1 2", "1 2"),
    ],
)  # fmt: skip
def test_plain_scalars_follow_yaml_1_2(written: str, meant: object) -> None:
    """No word becomes a boolean, no time or date a number or an object, no 0-number octal."""
    if written == "-":
        assert refused(f"v: {written}\n").code == "not-yaml"
        return
    assert data_of(f"v: {written}\n") == {"v": meant}
    assert type(data_of(f"v: {written}\n")["v"]) is type(meant)  # type: ignore[index]


def test_nan_is_read() -> None:
    """Whether a number may be undefined is for the shape pass to say."""
    value = data_of("v: .nan\n")["v"]  # type: ignore[index]
    assert math.isnan(value)


@pytest.mark.parametrize(
    ("path", "place"),
    [
        (("a",), (1, 1, 1, 4)),
        (("b", "c"), (3, 3, 3, 6)),
        (("b", "d"), (4, 3, 4, 6)),
        (("b", "d", 1), (0, 0, 4, 11)),
        (("e", 0, "f"), (6, 5, 6, 8)),
        (("e", 0, "g"), (7, 5, 7, 8)),
    ],
)
def test_marks_know_key_and_value(
    path: tuple[str | int, ...], place: tuple[int, int, int, int]
) -> None:
    """Lines and columns are 1-based; an item of a list has no key."""
    text = "a: 1\nb:\n  c: x\n  d: [10, 20]\ne:\n  - f: 1\n    g: 2\n"
    mark = parse_document(text, "f.yaml").at(path)
    assert mark is not None
    key = mark.key[:2] if mark.key else (0, 0)
    assert (*key, *mark.span[:2]) == place


@pytest.mark.parametrize(
    "text",
    [
        "v: one TWO three\n",
        "v: 'one TWO three'\n",
        "v: 'it''s one TWO'\n",
        'v: "one TWO three"\n',
        'v: "a\\x41\\n\\u0041 TWO three"\n',
        "v: |\n  one\n  two TWO three\n",
        "v: |\n\n  one\n\n  two TWO three\n",
        "v: >-\n  one\n  two TWO three\n",
        "v: >\n  one two\n\n  three\n  TWO\n",
        "v: one\n  two TWO\n  three\n",
        "v: 'one\n  two TWO\n  three'\n",
        "[{k: 1}, {v: one TWO}]\n",
    ],
)
def test_offset_inside_a_text_points_at_its_character(text: str) -> None:
    """Quotes, escapes, blocks and folded lines are counted as the reader counts them."""
    document = parse_document(text, "f.yaml")
    data = document.data
    path: tuple[str | int, ...] = ("v",)
    if isinstance(data, list):
        path, data = (1, "v"), data[1]
    assert isinstance(data, dict)
    offset = data["v"].index("TWO")
    problem = document.problem(path, "x", "x", offset=offset, length=3)
    assert problem.source[problem.column - 1 : problem.end_column - 1] == "TWO"


@pytest.mark.parametrize("offset", [0, 3, 4, 1000])
def test_offset_outside_a_text_still_gives_a_place(offset: int) -> None:
    """An error at the end of a pattern has an offset one past its last character."""
    problem = parse_document("v: 'abc'\n", "f.yaml").problem(("v",), "x", "x", offset=offset)
    assert problem.line == 1
    assert 4 <= problem.column <= 9


def test_problem_at_a_path_that_does_not_exist_shows_what_is_around_it() -> None:
    """A key that is missing is reported at the key of its mapping."""
    document = parse_document("a:\n  b: 1\n", "f.yaml")
    problem = document.problem(("a", "c", "d"), "x", "x", key=True)
    assert (problem.line, problem.column, problem.path) == (1, 1, "a.c.d")


def test_aliases_share_data_and_keep_their_own_place() -> None:
    """A fault inside the shared part is shown where it was written."""
    document = parse_document("a: &x { k: 1 }\nb: *x\n", "f.yaml")
    assert document.data == {"a": {"k": 1}, "b": {"k": 1}}
    assert document.problem(("b",), "x", "x").line == 2
    assert document.problem(("b", "k"), "x", "x").line == 1


def bomb(levels: int) -> str:
    lines = ["a0: &a0 x"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, levels)]
    return "\n".join(lines)


def test_alias_bomb_is_counted_not_expanded() -> None:
    """Nine to the fifteenth nodes are refused at the line that would make them."""
    problem = refused(bomb(16))
    assert (problem.code, problem.line) == ("too-many-nodes", 6)


def test_aliases_within_the_limits_are_allowed() -> None:
    """Nine lists of nine are no bomb."""
    data = data_of(bomb(3))
    assert isinstance(data, dict)
    assert data["a2"] == [["x"] * 9] * 9


def test_aliases_cannot_go_round_the_depth_limit() -> None:
    """Depth counts through aliases, so that nothing after the reader need fear recursion."""
    levels = "\n".join(f"a{n}: &a{n} [{f'*a{n - 1}' if n else 'x'}]" for n in range(100))
    assert refused(levels).code == "too-deep"


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (b"", "empty-document"),
        (b"\xef\xbb\xbf", "empty-document"),
        (b"---\n...\n", "empty-document"),
        (b"# only a comment\n", "empty-document"),
        (b"a: 1\n\0", "binary-file"),
        (b"\x7fELF\x02\x01\x01\0\0\0\xff", "binary-file"),
        (b"a: \xff\n", "not-utf-8"),
        ("a: 1\n".encode("utf-16"), "not-utf-8"),
        (b"a: \x1b[31m\n", "control-character"),
        ("a: \ufffe\n".encode(), "control-character"),
        (b"a: 1\n---\nb: 2\n", "several-documents"),
        (b"a: 1\n" * 300_000, "too-large"),
        (b"[" * 1_000_000, "too-deep"),
        (b"a: 1\na: 2\n", "duplicate-key"),
        (b"1: a\n", "key-not-text"),
        (b"[a]: b\n", "key-not-text"),
        (b"a: &x y\n*x : b\n", "key-not-text"),
        (b"? \n: b\n", "key-not-text"),
        (b"a: !!binary aGk=\n", "unknown-tag"),
        (b"a: !!int x\n", "wrong-tag"),
        (b"a: !!python/object:os.system x\n", "unknown-tag"),
        (b"a: !!set { x }\n", "unknown-tag"),
    ],
)
def test_what_is_no_document_is_refused_with_one_finding(content: bytes, code: str) -> None:
    """One line with a place, whatever the bytes are."""
    assert refused(content).code == code


class ShallowParser:
    """A parser that reads ahead and refuses deep nesting, as libyaml does since PyYAML 6.0.4."""

    def __init__(self, text: str) -> None:
        self.text = text

    def get_event(self) -> None:
        """Raise libyaml's error."""
        mark = yaml.Mark("", 1000, 0, 1000, None, None)
        raise yaml.scanner.ScannerError(
            "while increasing flow level", mark, "exceeded maximum nesting depth", mark
        )


def test_nesting_that_the_parser_refuses_is_reported_where_it_is_too_deep(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The same report, whatever the version of libyaml."""
    text = "a: " + "[" * 1000
    expected = refused(text)
    assert (expected.code, expected.column) == ("too-deep", 67)
    monkeypatch.setattr("urc.source._parser", ShallowParser)
    assert refused(text) == expected


def test_place_of_a_byte_that_is_not_utf_8() -> None:
    """Columns count characters, not bytes."""
    problem = refused("a: 1\nb: é".encode() + b"\xff\n")
    assert (problem.line, problem.column) == (2, 5)


def test_byte_order_mark_does_not_move_columns() -> None:
    """libyaml's own index is one off after it."""
    document = parse_document("\ufeffa: 1\n".encode(), "f.yaml")
    assert document.data == {"a": 1}
    mark = document.at(("a",))
    assert mark is not None
    assert mark.key == (1, 1, 1, 2)


def test_all_findings_of_the_reader_come_at_once() -> None:
    """Only what cannot be understood at all ends the reading."""
    with pytest.raises(ProblemsError) as caught:
        parse_document("a: 1\na: 2\n3: x\nb: *c\nd: [\n", "f.yaml")
    assert [problem.code for problem in caught.value.problems] == [
        "duplicate-key", "key-not-text", "unknown-alias", "not-yaml",
    ]  # fmt: skip


def test_findings_of_one_text_are_bounded() -> None:
    """A file full of faults does not become a report of its size."""
    with pytest.raises(ProblemsError) as caught:
        parse_document("[" + "*a, " * 5000 + "]", "f.yaml")
    assert len(caught.value.problems) == 100


@pytest.mark.parametrize("text", ["v: a #b\n", "v: [a #b\n ]\n", "v: #b\n"])
def test_comment_that_cuts_a_value_short_is_a_warning(text: str) -> None:
    """``send: MOVE #3`` would send MOVE."""
    document = parse_document(text, "f.yaml")
    assert [(one.code, one.severity) for one in document.problems] == [("cut-value", "warning")]


@pytest.mark.parametrize(
    "text", ["v: a # b\n", "v: 1 #b\n", "v: 'a' #b\n", "v: a#b\n", "v: a  #b\n"]
)
def test_ordinary_comments_are_no_finding(text: str) -> None:
    """A blank after the sign, a number or quotes before it: nobody meant a text."""
    assert parse_document(text, "f.yaml").problems == ()


def test_missing_file_suggests_its_neighbour(tmp_path: Path) -> None:
    """Most missing files are misspelt."""
    (tmp_path / "puppet.yaml").write_text("a: 1")
    problem = refused_file(tmp_path / "pupet.yaml")
    assert problem.code == "no-such-file"
    assert problem.hint == f"did you mean '{tmp_path / 'puppet.yaml'}'?"


def test_directory_names_a_document_in_it(tmp_path: Path) -> None:
    """The person meant one of the files inside."""
    (tmp_path / "b.yaml").write_text("a: 1")
    problem = refused_file(tmp_path)
    assert problem.code == "is-directory"
    assert problem.hint.endswith(str(tmp_path / "b.yaml"))


def test_pipe_is_refused_without_being_opened(tmp_path: Path) -> None:
    """Opening it would wait for a writer for ever."""
    os.mkfifo(tmp_path / "pipe.yaml")
    assert refused_file(tmp_path / "pipe.yaml").code == "not-a-file"


def test_million_lines_are_refused_by_size(tmp_path: Path) -> None:
    """The size is looked up before the file is opened."""
    file = tmp_path / "long.yaml"
    file.write_bytes(b"a: 1\n" * 1_000_000)
    problem = refused_file(file)
    assert (problem.code, problem.message) == ("too-large", "this document is larger than 1024 KiB")


@pytest.mark.parametrize(
    ("name", "code"),
    [("a\0b", "not-readable"), ("x" * 5000, "not-readable"), ("file/below", "no-such-file")],
)
def test_name_that_no_file_can_have(tmp_path: Path, name: str, code: str) -> None:
    """The system's own errors for names are findings too."""
    (tmp_path / "file").write_text("a: 1")
    assert refused_file(f"{tmp_path}/{name}").code == code


def test_link_to_itself_is_not_readable(tmp_path: Path) -> None:
    """A loop of symbolic links ends in one line."""
    (tmp_path / "loop.yaml").symlink_to(tmp_path / "loop.yaml")
    assert refused_file(tmp_path / "loop.yaml").code == "not-readable"


def test_file_without_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Said as what it is. (The super-user may read everything, so the refusal is acted.)"""
    file = tmp_path / "secret.yaml"
    file.write_text("a: 1")

    def refuse(*_: object) -> object:
        raise PermissionError(13, "Permission denied", str(file))

    monkeypatch.setattr("builtins.open", refuse)
    assert refused_file(file).code == "not-readable"


@pytest.mark.parametrize(
    ("text", "code", "place", "hint"),
    [
        ("r: *IDN?\n", "unknown-alias", (1, 4), "if it is text, quote it: '*IDN?'"),
        ("a: %1POWR ?\n", "unquoted", (1, 4), "quote it: '%1POWR ?'"),
        ("a: { b: @00, c: 1 }\n", "unquoted", (1, 9), "quote it: '@00'"),
        ("a: `x`\n", "unquoted", (1, 4), "quote it: '`x`'"),
        ("a: !CAL\n", "unknown-tag", (1, 4), "if it is text, quote it: '!CAL'"),
        ("a: {{ x.y }}\n", "unquoted-template", (1, 4), "quote it: '{{ x.y }}'"),
        ("a: {{ x['y'] }}\n", "unquoted-template", (1, 4), "quote it: \"{{ x['y'] }}\""),
        ("a:\n\tb: 1\n", "tab", (2, 1), "YAML indents with spaces only: two for each level"),
        ("a: b: c\n", "unquoted", (1, 5), "quote it: 'b: c'"),
        ("a: 'x\n", "open-quote", (1, 4), "end the text with '"),
        ("a: [1, 2\n", "open-bracket", (1, 4), "close it with ']' at the end of this line"),
        ('a: "\\d"\n', "bad-escape", (1, 5),
         "use single quotes, where a backslash is plain text and '' is a quote; in double quotes,"
         " write a backslash as \\\\"),
        ('a: "\\xZZ"\n', "bad-escape", (1, 5),
         "use single quotes, where a backslash is plain text and '' is a quote; in double quotes,"
         " write a backslash as \\\\"),
    ],
)  # fmt: skip
def test_traps_of_yaml_are_told_with_their_remedy(
    text: str, code: str, place: tuple[int, int], hint: str
) -> None:
    """Each trap of the language reference, at the place where the quote is missing."""
    problem = refused(text)
    assert (problem.code, (problem.line, problem.column), problem.hint) == (code, place, hint)


def test_both_parsers_of_pyyaml_are_understood(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without libyaml the reports are the same, though the parser's own words differ."""
    import urc.source
    from urc._yaml_pure import PureParser

    texts = [
        "a: *b?", "a: %x", "a: @x", "a: !x", "a: {{ x }}", "a:\n\tb: 1", "a: b: c", "a: 'x",
        'a: "x', "a: [1", "a: {b: 1", 'a: "\\d"', "a\nb: 1", "a: 1\n  b: 2", "- a\nb: 1", "a: - b",
        "a: &", "%x y", "a: 'x' y", "a: ]", "a: |x", " a: 1\nb: 2", "a: 1\na: 2", "a: &x [*x]",
        "a: x #y", "? a\n: b", "a: ?", "---\na: 1\n---\nb: 1", "a: { b: MODE?, c: d? }",
        "a: [x?y, ?z]", "a: { b: x:, c: 1 }", "a: { http://h:80/p }", "a: {?b: 1}", "a: [b: c?]",
    ]  # fmt: skip

    def outcome(text: str) -> list[str]:
        try:
            document = parse_document(text, "f.yaml")
        except ProblemsError as error:
            return [to_text(problem) for problem in error.problems]
        return [repr(document.data), *map(to_text, document.problems)]

    by_c = [outcome(text) for text in texts]
    monkeypatch.setattr(urc.source, "_parser", PureParser)
    assert [outcome(text) for text in texts] == by_c
