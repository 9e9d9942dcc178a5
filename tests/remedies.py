"""Apply the hint of a problem to its document, as a person would who reads nothing but the hint.

Each rule knows one form of sentence. A hint without a rule changes nothing, and the document stays
wrong: a hint that a script can't follow counts as none.
"""

import re
from collections.abc import Callable

from urc.problems import Problem

__all__ = ["apply"]

Rule = Callable[[str, Problem, re.Match[str]], str]


def apply(text: str, problem: Problem) -> str:
    """Return the document after the hint, or the same text if no rule fits the hint."""
    for pattern, rule in _RULES:
        found = re.search(pattern, problem.hint or problem.message)
        if found:
            return rule(text, problem, found)
    return text


def _span(text: str, problem: Problem) -> tuple[int, int]:
    lines = text.splitlines(keepends=True)
    start = sum(map(len, lines[: problem.line - 1])) + problem.column - 1
    return start, start + max(1, problem.end_column - problem.column)


def _write(text: str, problem: Problem, new: str) -> str:
    start, end = _span(text, problem)
    return text[:start] + new + text[end:]


def _put(group: int = 1, form: str = "{}") -> Rule:
    """Write a part of the hint over the underlined text."""
    return lambda text, problem, found: _write(text, problem, form.format(found[group]))


def _value_after_key(text: str, problem: Problem) -> re.Match[str]:
    """Return the underlined key with its value, up to a comma, a brace or the end of the line."""
    start, _ = _span(text, problem)
    entry = re.compile(r"""([\w-]+):[ ]*("[^"]*"|'[^']*'|[^,}\n]*)""").match(text, start)
    assert entry is not None
    return entry


def _replace_entry(text: str, problem: Problem, found: re.Match[str]) -> str:
    entry = _value_after_key(text, problem)
    return text[: entry.start()] + found[1] + text[entry.end() :]


def _replace_by_lines(text: str, problem: Problem, found: re.Match[str]) -> str:
    entry = _value_after_key(text, problem)
    indent = "\n" + " " * (problem.column - 1)
    old = text[: entry.start()] + found[1].replace(", ", indent) + text[entry.end() :]
    lines = old.splitlines(keepends=True)  # a key that is now there twice was there before
    keys = re.findall(r"(\w+): ", found[1])
    kept, seen = [], set[str]()
    for number, line in enumerate(lines):
        key = re.match(r"\s*(\w+):", line)
        if number >= problem.line - 1 and key and key[1] in keys:
            if key[1] in seen:
                continue
            seen.add(key[1])
        kept.append(line)
    return "".join(kept)


def _insert(text: str, problem: Problem, found: re.Match[str]) -> str:
    """Insert an entry into the mapping of the underlined key."""
    lines = text.splitlines(keepends=True)
    line = lines[problem.line - 1]
    after = line[problem.column - 1 :]
    flow = re.match(r"[\w-]+:\s*\{\s*", after)
    if flow:
        place = problem.column - 1 + flow.end()
        lines[problem.line - 1] = line[:place] + found[1] + ", " + line[place:]
    else:
        indent = re.match(r"\s*", lines[problem.line])
        assert indent is not None
        lines.insert(problem.line, f"{indent[0]}{found[1]}\n")
    return "".join(lines)


def _first_line(text: str, problem: Problem, found: re.Match[str]) -> str:
    return f"{found[1]}\n{text}"


def _whole_line(text: str, problem: Problem, found: re.Match[str]) -> str:
    lines = text.splitlines(keepends=True)
    lines[problem.line - 1] = f"{found[1]}\n"
    return "".join(lines)


def _swap(text: str, problem: Problem, found: re.Match[str]) -> str:
    """Exchange the values of 'min' and 'max' in the underlined line."""
    lines = text.splitlines(keepends=True)
    line = lines[problem.line - 1]
    low, high = (re.search(rf"\b{key}: ([-0-9.]+)", line) for key in ("min", "max"))
    assert low is not None
    assert high is not None
    line = (
        line[: low.start(1)]
        + high[1]
        + line[low.end(1) : high.start(1)]
        + low[1]
        + line[high.end(1) :]
    )
    lines[problem.line - 1] = line
    return "".join(lines)


def _swap_named(text: str, problem: Problem, found: re.Match[str]) -> str:
    """Write both entries with the values of the hint, wherever they are in the line."""
    lines = text.splitlines(keepends=True)
    line = lines[problem.line - 1]
    for key, value in re.findall(r"(\w+): ([-0-9.]+)", found[1]):
        line = re.sub(rf"\b{key}: [-0-9.]+", f"{key}: {value}", line, count=1)
    lines[problem.line - 1] = line
    return "".join(lines)


def _indent(text: str, problem: Problem, found: re.Match[str]) -> str:
    """Indent a line by two spaces more than the key above."""
    lines = text.splitlines(keepends=True)
    above = lines[problem.line - 2]
    deep = len(above) - len(above.lstrip()) + 2
    lines[problem.line - 1] = " " * deep + lines[problem.line - 1].lstrip()
    return "".join(lines)


def _single_quotes(text: str, problem: Problem, found: re.Match[str]) -> str:
    """Put the double-quoted text around the place into single quotes."""
    start, _ = _span(text, problem)
    left, right = text.rindex('"', 0, start), text.index('"', start)
    return f"{text[:left]}'{text[left + 1 : right]}'{text[right + 1 :]}"


def _two_braces(text: str, problem: Problem, found: re.Match[str]) -> str:
    """Write the argument of the hint in two braces, from the place on."""
    send, _ = _span(text, problem)
    return text[:send] + text[send:].replace(f"{{{found[1]}}}", f"{{{{ {found[1]} }}}}", 1)


def _boolean(text: str, problem: Problem, found: re.Match[str]) -> str:
    start, end = _span(text, problem)
    return _write(text, problem, "true" if text[start:end].lower() in ("yes", "on") else "false")


def _pad_row(text: str, problem: Problem, found: re.Match[str]) -> str:
    lines = text.splitlines(keepends=True)
    lines[problem.line - 1] = lines[problem.line - 1].rstrip("\n") + " .\n"
    return "".join(lines)


def _remove_block(text: str, problem: Problem, found: re.Match[str]) -> str:
    """Remove the underlined key and everything below it."""
    lines = text.splitlines(keepends=True)
    first = problem.line - 1
    last = first + 1
    while last < len(lines) and len(lines[last]) - len(lines[last].lstrip()) >= problem.column:
        last += 1
    return "".join(lines[:first] + lines[last:])


def _dash(text: str, problem: Problem, found: re.Match[str]) -> str:
    """Write '- ' before the first line below the key."""
    lines = text.splitlines(keepends=True)
    row = lines[problem.line]
    deep = len(row) - len(row.lstrip())
    lines[problem.line] = f"{row[: deep - 2]}- {row[deep:]}"
    return "".join(lines)


def _rows(text: str, problem: Problem, found: re.Match[str]) -> str:
    """Write a list as a block of text."""
    lines = text.splitlines(keepends=True)
    lines[problem.line - 1] = lines[problem.line - 1].rstrip("\n") + " |\n"
    for number in range(problem.line, len(lines)):
        if not lines[number].lstrip().startswith("- "):
            break
        lines[number] = lines[number].replace("- ", "  ", 1)
    return "".join(lines)


def _named_group(text: str, problem: Problem, found: re.Match[str]) -> str:
    start, _ = _span(text, problem)
    lines = text[start - 2 :]
    return text[: start - 2] + re.sub(r"\(\?<", "(?P<", lines, count=1)


def _start_in_column(text: str, problem: Problem, found: re.Match[str]) -> str:
    lines = text.splitlines(keepends=True)
    lines[problem.line - 1] = " " * (int(found[1]) - 1) + lines[problem.line - 1].lstrip()
    return "".join(lines)


def _end_of_line(text: str, problem: Problem, found: re.Match[str]) -> str:
    lines = text.splitlines(keepends=True)
    lines[problem.line - 1] = f"{lines[problem.line - 1].rstrip()}{found[1]}\n"
    return "".join(lines)


def _comma_before(text: str, problem: Problem, found: re.Match[str]) -> str:
    start, _ = _span(text, problem)
    return f"{text[:start].rstrip()}, {text[start:]}"


def _quote(text: str, problem: Problem, found: re.Match[str]) -> str:
    """Write the quoted text over the same text without quotes, in the underlined line."""
    lines = text.splitlines(keepends=True)
    plain = found[1][1:-1]
    if plain not in lines[problem.line - 1]:
        return _write(text, problem, found[1])
    lines[problem.line - 1] = lines[problem.line - 1].replace(plain, found[1], 1)
    return "".join(lines)


def _indent_entry(text: str, problem: Problem, found: re.Match[str]) -> str:
    """Indent an entry, at or below the underlined line, by two more spaces."""
    lines = text.splitlines(keepends=True)
    for number in range(problem.line - 1, len(lines)):
        if lines[number].lstrip().startswith(f"{found[1]}:"):
            lines[number] = f"  {lines[number]}"
            break
    return "".join(lines)


def _without_dashes(text: str, problem: Problem, found: re.Match[str]) -> str:
    """Remove the dashes of the list below the underlined key."""
    lines = text.splitlines(keepends=True)
    for number in range(problem.line, len(lines)):
        deep = len(lines[number]) - len(lines[number].lstrip())
        if lines[number].strip() and deep < problem.column:
            break
        lines[number] = re.sub(r"^( +)- ", r"\1", lines[number])
    return "".join(lines)


def _unchanged(text: str, problem: Problem, found: re.Match[str]) -> str:
    return text


_RULES: tuple[tuple[str, Rule], ...] = (
    (r"^use the (?:key|word|type) '([^']+)'", _put()),
    (r"^write 'kind: (\w+)'$", _put()),
    (r"^did you mean '([^']+)'\?", _put()),
    (r"^the new name is '([^']+)'", _put()),
    (r"^write the name without braces: (\S+)", _put()),
    (r"^write the unit: (\S+),", _put()),
    (r"^remove the quotes: (\S+)", _put()),
    (r"^quote it: (\"[^\"]*\"):$", _put()),
    (r"^quote it: ('[^']*'|\"[^\"]*\")$", _quote),
    (r"^if '#' belongs to the value, quote it: ('[^']*')", _quote),
    (r"^write the number (?:alone|with a point): (\S+)$", _put()),
    (r"^put a colon after the key: '([^']+)'$", lambda t, p, f: _line_rest(t, p, f[1])),
    (r"^put a space after the dash: '([^']+)'$", lambda t, p, f: _line_rest(t, p, f[1])),
    (r"^put a comma before the key: ", _comma_before),
    (r"^start this line in column (\d+), like line", _start_in_column),
    (r"^start the comment with '#': (.+)$", lambda t, p, f: _line_rest(t, p, f[1])),
    (r"^write straight quotes: (\"[^\"]*\")$", _put()),
    (r"^end the text with ([\"'])$", _end_of_line),
    (r"^close it with '([}\]])' at the end of this line$", _end_of_line),
    (r"^indent '(\w+)' by two more spaces", _indent_entry),
    (r"^write the entries without '- '$", _without_dashes),
    (r"^write (release: \{ \w[^}]*\}) with arguments that stop the robot", _insert),
    (r"^bind it as (\{.*\})$", _put()),
    (r"\bwrite a mapping, such as (\{.*\})$", _put()),
    (r"^(?:text in an expression needs quotes of its own|an index is in brackets): (.+)$", _put()),
    (r"^for lines of text, write framing: \{ (.*) \}$", lambda t, p, f: _write_type(t, p, f[1])),
    (r"^for most text protocols: (framing: \{.*\})$", _insert),
    (r"^for example '([\w-]+: [^']+)'$", _insert),
    (r"^put a space after the colon: '([^']+)'", lambda t, p, f: _line_rest(t, p, f[1])),
    (r"^write 'host' and 'port': (.+)$", _replace_by_lines),
    (r"^write '(urc: 1)' in the first line$", _first_line),
    (r"^write '(urc: 1)'$", _whole_line),
    (r"^swap the two values: (\w+: [-0-9.]+, \w+: [-0-9.]+)$", _swap_named),
    (r"^swap the two names: (\w+: \w+)$", _replace_entry),
    (r"^swap the two values$", _swap),
    (r"^write the type first: (\w+ \w+)$", _replace_entry),
    (r"YAML indents with spaces only", _indent),
    (r"^use single quotes", _single_quotes),
    (r"^write two braces: \{\{ (\w+) \}\}$", _two_braces),
    (r"write true or false$", _boolean),
    (r"^every row needs the same number of cells; '\.' is an empty cell$", _pad_row),
    (r"^keep one of them", _remove_block),
    (r"^write a list: '- ' before each item", _dash),
    (r"^write the rows below 'grid: \|', without '- '$", _rows),
    (r"a named group begins with \(\?P<", _named_group),
    (r"^write (settings\.\w+)$", _put()),
    (r"^write (\w+), or ", _put()),
    (r"^write ([A-Z]+|[a-z0-9-]+)(?:$|; )", _put()),
)
"""Forms of hints, as regular expressions."""


def _write_type(text: str, problem: Problem, entries: str) -> str:
    """Write entries such as ``type: delimiter, tx: LF`` over the underlined entry."""
    start, end = _span(text, problem)
    key = text.rindex("type:", 0, start)
    return text[:key] + entries + text[end:]


def _line_rest(text: str, problem: Problem, entry: str) -> str:
    """Write an entry over the rest of the line."""
    start, _ = _span(text, problem)
    return text[:start] + entry + text[text.index("\n", start) :]
