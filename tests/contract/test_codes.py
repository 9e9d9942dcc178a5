"""Every code that a person may meet has a page, and each page's examples prove what it says."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.contract.modules import MODULES, ROOT, tree_of
from urc.cli.main import main
from urc.config.codes import CodePage, pages
from urc.config.load import WidgetFolder, check
from urc.runtime.document_tests import exercise
from urc.runtime.registries import built_in_catalog

BROKEN = ROOT / "tests" / "broken"
CODE = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
COMPOUND = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)+")
HEADLINE = re.compile(r"^\S+:\d+:\d+: (?:error|warning) (\S+?)[ :]", re.MULTILINE)

# Who takes a code, and at which place among the arguments. None: wherever a word with a hyphen is.
TAKERS: dict[str, int | None] = {
    "error": 1,
    "warn": 1,
    "problem": 1,
    "refused": 1,
    "unknown": 1,
    "Problem": 0,
    "_report": 1,
    "Failed": 2,
    "FrameFault": 0,
    "Violation": 1,
    "Fault": None,
    "_failed": None,
    "_unknown": None,
    "_Fault": None,
}


def codes_of(tree: ast.AST) -> Iterator[str]:
    """Yield every code that a module uses, as far as it is written out there."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if name in TAKERS:
                yield from _written(node, TAKERS[name])
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            is_code = any(isinstance(one, ast.Name) and one.id == "code" for one in targets)
            if is_code and node.value is not None:
                yield from _strings(node.value, CODE)
        elif isinstance(node, ast.keyword) and node.arg == "code":
            yield from _strings(node.value, CODE)


def _written(call: ast.Call, place: int | None) -> Iterator[str]:
    if place is None:
        for argument in call.args:
            yield from _strings(argument, COMPOUND)
    elif len(call.args) > place + 1:  # logging's `error` takes no code
        yield from _strings(call.args[place], CODE)


def _strings(value: ast.expr, pattern: re.Pattern[str]) -> Iterator[str]:
    """Yield the texts that an expression may be: `"a" if x else "b"` is one of two."""
    if isinstance(value, ast.IfExp):
        yield from _strings(value.body, pattern)
        yield from _strings(value.orelse, pattern)
    elif isinstance(value, ast.Constant) and pattern.fullmatch(str(value.value)):
        yield str(value.value)


def used() -> dict[str, str]:
    """Return every code that is used anywhere, and where."""
    found = {}
    for path in MODULES:
        for code in codes_of(tree_of(path)):
            found.setdefault(code, str(path.relative_to(ROOT)))
    for path in sorted(BROKEN.rglob("*.expected.txt")):
        for code in re.findall(
            r"^\S+:\d+:\d+: (?:error|warning) (\S+?)[ :]", path.read_text("utf-8"), re.M
        ):
            found.setdefault(code, str(path.relative_to(ROOT)))
    return found


PAGES = pages()


def test_every_code_has_a_page() -> None:
    """A code without a page would leave `urc explain` without an answer."""
    assert {code: where for code, where in used().items() if code not in PAGES} == {}


def test_every_page_is_of_a_code_that_is_used() -> None:
    """A page of a code that nothing reports any more misleads."""
    sources = "".join(path.read_text("utf-8") for path in MODULES if path.name != "renames.py")
    assert [code for code in PAGES if f'"{code}"' not in sources] == []


def test_pages_are_in_the_order_of_the_alphabet() -> None:
    """Somebody who looks for a code in the file finds it."""
    assert list(PAGES) == sorted(PAGES)


@pytest.mark.parametrize("page", PAGES.values(), ids=list(PAGES))
def test_page_has_all_four_parts(page: CodePage) -> None:
    """What, Why, Example, Use instead; the first two are sentences on one line."""
    assert CODE.fullmatch(page.code)
    for text in (page.what, page.why):
        assert text.endswith(".")
        assert "\n" not in text
    assert page.example.strip()
    assert page.instead.strip()


# ---- the examples

SECTIONS = {
    "urc": "urc: 1\n",
    "kind": "kind: robot\n",
    "name": "name: example\n",
    "settings": "settings:\n  host: { type: host, default: 127.0.0.1 }\n",
    "transports": (
        'transports:\n  wire:\n    type: tcp\n    host: "{{ settings.host }}"\n    port: 6789\n'
        "    framing: { type: delimiter, tx: LF, rx: LF }\n"
    ),
    "signals": 'signals:\n  battery: { type: integer, unit: "%" }\n  mode: { type: string }\n',
    "messages": "messages:\n  state: { regex: '^(?P<battery>[0-9]+) (?P<mode>[a-z]+)$' }\n",
}
"""A document of which an example replaces some parts."""


def document_of(example: str) -> str:
    """Return a whole document: the example itself, or the example in place of its own parts."""
    if example.startswith("urc:") or not re.match(r"[a-z_]+:", example):
        return example
    own = set(re.findall(r"^([a-z_]+):", example, re.MULTILINE))
    if "driver" in own:
        own |= {"transports", "signals", "messages"}
    if "signals" in own:
        own.add("messages")  # what they capture may be no signal here
    if own & {"driver", "transports"} and "settings" not in example:
        own.add("settings")
    return "".join(text for key, text in SECTIONS.items() if key not in own) + example


def problems(example: str, folder: Path) -> dict[str, str]:
    """Return the codes, with their severity, of what `urc validate` says about an example."""
    for part in (BROKEN / "parts").glob("*.yaml"):
        target = folder / "parts" / part.name
        target.parent.mkdir(exist_ok=True)
        target.write_bytes(part.read_bytes())
    text = document_of(example)
    kind = re.search(r"^kind: (\w+)$", text, re.MULTILINE)
    name = re.search(r"^name: ([\w-]+)$", text, re.MULTILINE)
    file = folder / f"{name[1] if name else 'example'}.yaml"
    if kind is not None and kind[1] == "widget":
        file = folder / "lamp" / "widget.yaml"
        file.parent.mkdir(exist_ok=True)
    file.write_text(text, "utf-8")
    checked = check(file, built_in_catalog(), WidgetFolder(BROKEN / "shelf"))
    problems = list(checked.problems)
    if checked.profile is not None:
        problems += exercise(checked.profile).problems
    return {problem.code: problem.severity for problem in problems}


def is_document(page: CodePage, text: str) -> bool:
    """Return whether a part of a page is code: in the file it stands in a fence."""
    source = (ROOT / "urc" / "config" / "codes.md").read_text("utf-8")
    return f"```yaml\n{text}\n```" in source


CASES = [
    pytest.param(page.code, page.example, True, id=f"{page.code} example")
    for page in PAGES.values()
    if is_document(page, page.example)
] + [
    pytest.param(page.code, page.instead, False, id=f"{page.code} instead")
    for page in PAGES.values()
    if is_document(page, page.instead)
]


@pytest.mark.cases(60)
@pytest.mark.parametrize(("code", "text", "is_fault"), CASES)
def test_example_shows_its_code_and_the_other_does_not(
    code: str, text: str, is_fault: bool, tmp_path: Path
) -> None:
    """Each is checked as `urc validate` checks it; the remedy may have warnings, but no error."""
    found = problems(text, tmp_path)
    assert (code in found) == is_fault, found
    assert is_fault or "error" not in found.values(), found


# ---- the verb


def test_explain_prints_a_page_and_a_list(capsys: pytest.CaptureFixture[str]) -> None:
    """Plain text, no colour, no pager."""
    assert main(["explain", "unknown-key"]) == 0
    page = capsys.readouterr().out
    assert page.startswith("unknown-key\n\nWhat: ")
    assert "\n\nUse instead:\n    " in page
    assert main(["explain"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(PAGES)


def test_explain_suggests_the_code_that_was_meant(capsys: pytest.CaptureFixture[str]) -> None:
    """Wrong use, told in one line."""
    assert main(["explain", "unknown-kye"]) == 2
    told = "urc explain: unknown code 'unknown-kye'; did you mean 'unknown-key'?\n"
    assert capsys.readouterr().err == told
