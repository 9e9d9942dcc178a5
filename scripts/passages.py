"""Extract the prose from the tree: documentation, docstrings, and user-visible strings.

`scripts/sentences.py` and `scripts/prose.py` use this module, so they share one definition of
prose. Generated pages (docs/reference, docs/robots, docs/gallery), tests, code blocks and licences
are excluded.
"""

import ast
import json
import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import yaml

__all__ = ["Passage", "Sentence", "is_read", "passages", "sentences"]

GENERATED = ("docs/reference/", "docs/robots/", "docs/gallery/")
CODE_FOLDERS = ("urc/", "bench/", "scripts/")
YAML_FOLDERS = ("robots/", "widgets/")
PROSE_KEYS = ("title", "summary", "description", "help", "notes", "why")
"""Keys of schemas and documents whose values are prose."""
FEWEST_WORDS = 4
"""Minimum number of words in a sentence from code; a shorter string is a name or a label."""

_FENCE = re.compile(r"^\s*(```|~~~)")
_ITEM = re.compile(r"^\s*(?:[-*+]|\d+\.)\s+|^\s*#+\s+|^\s*>\s?")
_SECTIONS = ("Args:", "Attributes:", "Raises:", "Returns:", "Yields:")
_ENTRY = re.compile(r"^\s+\*{0,2}\w+(?: \([^)]*\))?: ")
"""Pattern that matches the start of an entry under `Args:` or `Raises:`."""
_QUERY = re.compile(r"(?:CREATE TABLE|DELETE FROM|INSERT INTO|PRAGMA|SELECT|WHERE)\b")
"""Pattern that matches the start of an SQL statement, which is not prose."""
_LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
_MARKED = re.compile(r"""\b(?:t|mark|phrase)\(\s*(?:"((?:[^"\\\n]|\\.)*)"|'((?:[^'\\\n]|\\.)*)')""")
_WORD = re.compile(
    r"""[("“‘'*]*(?:[A-Za-z][a-z’'-]*|[A-Z]+|\{\}|`[^`]+`|[0-9]+)[)."”’:;,!?…%*']*"""
)
_END = re.compile(r"[.!?][)\"”*]*\s+(?=[\"“(*`A-Z0-9])")


class Passage(NamedTuple):
    """A passage of prose: a paragraph, a list item, a table cell or a string."""

    path: str
    line: int
    kind: str
    """Source of the passage: `docs`, `docstring` or `string`."""
    text: str
    """Text with its line breaks, which are needed to compute each sentence's line."""


class Sentence(NamedTuple):
    """One sentence with its path, line and kind."""

    path: str
    line: int
    kind: str
    text: str


def is_read(path: str) -> bool:
    """Return whether prose is extracted from files at this path."""
    if path.startswith(GENERATED):
        return False
    if path.endswith(".md"):
        return "/" not in path or path.startswith(("docs/", "urc/"))
    if path.endswith(".py"):
        return path.startswith(CODE_FOLDERS) or "/" not in path
    if path.startswith("schemas/"):
        return path.endswith(".json")
    if path.endswith((".j2", ".js")):
        return path.startswith(("templates/", "widgets/", "urc/web/"))
    return path == "dev" or (path.startswith(YAML_FOLDERS) and path.endswith(".yaml"))


def passages(files: Mapping[str, str]) -> Iterator[Passage]:
    """Yield every passage of prose in `files`, a mapping of path to text, sorted by path."""
    for path in sorted(files):
        text = files[path]
        if path.endswith(".md"):
            yield from _of_markdown(path, text)
        elif path.endswith(".py") or path == "dev":
            yield from _of_python(path, text)
        elif path.endswith(".json"):
            yield from _of_schema(path, text)
        elif path.endswith(".yaml"):
            yield from _of_document(path, text)
        else:
            yield from _of_page(path, text)


def sentences(found: Passage) -> Iterator[Sentence]:
    """Yield the sentences of a passage, each with its own line number."""
    start = 0
    for end in [*(match.end() for match in _END.finditer(found.text)), len(found.text)]:
        piece = found.text[start:end]
        blank = len(piece) - len(piece.lstrip())
        line = found.line + found.text.count("\n", 0, start + blank)
        if text := " ".join(piece.split()):
            yield Sentence(found.path, line, found.kind, text)
        start = end


def _of_markdown(path: str, text: str) -> Iterator[Passage]:
    fence = ""
    lines: list[tuple[int, str]] = []
    for number, line in enumerate([*text.splitlines(), ""], 1):
        mark = _FENCE.match(line)
        is_code = bool(fence or mark)
        if mark and fence in ("", mark[1]):
            fence = "" if fence else mark[1]
        is_row = line.lstrip().startswith("|")
        if is_code or is_row or not line.strip() or _ITEM.match(line):
            yield from _paragraph(path, "docs", lines)
            lines = []
        if is_code:
            continue
        if is_row:
            for cell in re.split(r"(?<!\\)\|", line.strip().strip("|")):
                yield from _paragraph(path, "docs", [(number, cell)])
        elif line.strip():
            lines.append((number, _ITEM.sub("", line)))


def _paragraph(path: str, kind: str, lines: list[tuple[int, str]]) -> Iterator[Passage]:
    text = _LINK.sub(r"\1", "\n".join(line for _, line in lines)).replace("**", "")
    if re.search("[A-Za-z]", text):
        yield Passage(path, lines[0][0], kind, text)


def _of_python(path: str, text: str) -> Iterator[Passage]:
    tree = ast.parse(text)
    apart: set[ast.AST] = set()
    """String nodes to skip, because a docstring or f-string already contains them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            apart.add(node.value)
            if isinstance(node.value.value, str):
                yield from _of_docstring(path, node.lineno, node.value.value)
        elif isinstance(node, ast.JoinedStr):
            apart.update(node.values)
            pieces = (_constant(value) for value in node.values)
            yield from _of_string(path, node.lineno, "".join(pieces))
        elif isinstance(node, ast.Constant) and node not in apart and isinstance(node.value, str):
            yield from _of_string(path, node.lineno, node.value)


def _constant(value: ast.expr) -> str:
    return str(value.value) if isinstance(value, ast.Constant) else "{}"


def _of_docstring(path: str, line: int, text: str) -> Iterator[Passage]:
    lines: list[tuple[int, str]] = []
    after_blank = is_section = False
    for number, one in enumerate([*text.splitlines(), ""], line):
        inner = one.lstrip()
        if after_blank or not inner:
            is_section = inner in _SECTIONS
        is_entry = is_section and bool(_ENTRY.match(one))
        is_example = after_blank and len(one) - len(inner) > _indent(text) + 3
        if not inner or _ITEM.match(one) or is_entry or is_example:
            yield from _paragraph(path, "docstring", lines)
            lines = []
        if inner and not is_example:
            lines.append((number, _ITEM.sub("", one)))
        after_blank = not inner or is_example


def _indent(text: str) -> int:
    rest = [one for one in text.splitlines()[1:] if one.strip()]
    return min((len(one) - len(one.lstrip()) for one in rest), default=0)


def _of_string(path: str, line: int, text: str) -> Iterator[Passage]:
    words = text.split()
    fit = sum(1 for word in words if _WORD.fullmatch(word))
    if len(words) >= FEWEST_WORDS and not _QUERY.match(text) and fit >= 0.8 * len(words):
        yield Passage(path, line, "string", text)


def _of_schema(path: str, text: str) -> Iterator[Passage]:
    keys = "|".join(PROSE_KEYS)
    for match in re.finditer(rf'"(?:{keys})":\s*("(?:[^"\\]|\\.)*")', text):
        line = text.count("\n", 0, match.start()) + 1
        yield Passage(path, line, "string", json.loads(match[1]))


def _of_document(path: str, text: str) -> Iterator[Passage]:
    waiting: list[yaml.Node] = list(yaml.compose_all(text, yaml.SafeLoader))
    while waiting:
        node = waiting.pop(0)
        if isinstance(node, yaml.SequenceNode):
            waiting.extend(node.value)
        if not isinstance(node, yaml.MappingNode):
            continue
        for key, value in node.value:
            waiting.append(value)
            if isinstance(value, yaml.ScalarNode) and key.value in PROSE_KEYS:
                yield Passage(path, value.start_mark.line + 1, "string", value.value)


def _of_page(path: str, text: str) -> Iterator[Passage]:
    for match in _MARKED.finditer(text):
        said = match[1] or match[2] or ""
        yield Passage(path, text.count("\n", 0, match.start()) + 1, "string", said)
