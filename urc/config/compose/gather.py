"""The first passes: read a document and check its shape, then those that it refers to.

The result says, for each part of a profile, in which document it stands: a robot may keep its
driver and its interfaces in files of their own, and each of them may build on others.
"""

from typing import Final, NamedTuple

from urc.config.compose.each import expand
from urc.config.compose.library import Library
from urc.config.compose.merge import Tree, merge
from urc.config.compose.params import fill_params
from urc.config.part import Findings, Part
from urc.config.shape.check import check_shape, kind_of, read_schema
from urc.problems import Problem, ProblemsError, has_errors
from urc.source import Document

__all__ = ["RESERVED", "Gathered", "Sources", "gather"]

_EMULATED: Final = ("signals", "state", "world")
"""Keys of a simulator that are no transports: the values with which it begins, and its world."""
RESERVED: Final = (*_EMULATED, "rules")
"""Keys of a simulator that cannot be names of transports."""


class Sources:
    """Where each part of a profile stands."""

    def __init__(self, root: Part, kind: str) -> None:
        self.root = root
        self.kind = kind
        self.driver = root
        """The mapping with transports, signals, messages, commands and polls."""
        self.settings: dict[str, Part] = {}
        self.slots: dict[str, list[Part]] = {}
        """Slot → what fills it; a later entry changes an earlier one."""
        self.interfaces: dict[str, Part] = {}
        self.tests: list[Part] = []
        self.simulator: dict[str, Part] = {}
        """What an emulated robot is, but for its rules."""
        self.rules: dict[str, Part] = {}
        """Rules of the emulated robot by transport."""

    def add(self, part: Part) -> None:
        """Take what `part` says beside its wire; it goes before what was there."""
        self.settings |= part.named("settings")
        for slot, use in part.named("widgets").items():
            self.slots.setdefault(slot, []).append(use)
        self.tests += part.listed("tests")
        simulator = part.get("simulator")
        if simulator is None:
            return
        for key in _EMULATED:
            inner = simulator.get(key)
            if inner is not None:
                self.simulator[key] = _over(self.simulator.get(key), inner)
        rules = {name: one for name, one in simulator.entries().items() if name not in RESERVED}
        for name, inner in (rules | simulator.named("rules")).items():
            self.rules[name] = _over(self.rules.get(name), inner)


def _over(below: Part | None, part: Part) -> Part:
    """Return a part of a simulator with what stands below it, in the driver's document."""
    if below is None:
        return part
    merged = merge(_tree(below), _tree(part), part.path)
    home, value, mark = merged.home, merged.value, merged.mark
    for key in reversed(part.path):
        value, mark = {key: value}, mark.copy({key: mark})
    document = Document(home.file, home.text, home.lines, value, mark)
    return Part(document, part.path, merged.value)


def _tree(part: Part) -> Tree:
    mark = part.document.at(part.path)
    assert mark is not None, part.path  # noqa: S101  # what stands there has a mark
    return Tree(part.data, mark, part.document.source_of(part.path))


class Gathered(NamedTuple):
    """What the first passes give."""

    sources: Sources | None
    """None when an error stops here, or the document is only a part of others."""
    problems: list[Problem]
    kind: str
    files: tuple[str, ...]
    """Every file that was looked at, whether there is one or not."""


def gather(path: str) -> Gathered:
    """Return where everything is, or the errors that stop here."""
    library = Library()
    try:
        document = library.read(path)
    except ProblemsError as error:
        return Gathered(None, list(error.problems), "", tuple(library.files))
    kind = kind_of(document)
    findings = library.findings
    findings.problems += document.findings
    root = _shaped(document, library)
    sources = None
    if root is not None and not _is_part(root):
        sources = Sources(Part(root, (), root.data), kind)
        if kind == "robot":
            _gather_robot(sources, library)
        elif kind == "driver":
            sources.add(sources.root)
    if has_errors(findings):
        sources = None
    problems = list(dict.fromkeys(findings))
    return Gathered(sources, problems, "" if has_errors(problems) else kind, tuple(library.files))


def _is_part(document: Document) -> bool:
    return isinstance(document.data, dict) and document.data.get("partial") is True


def _shaped(
    document: Document, library: Library, given: Part | None = None, use: Part | None = None
) -> Document | None:
    """Return a document put together, written out and of the right shape, or None.

    Args:
        document: as it stands in its file.
        library: reads what it builds on, and takes the findings.
        given: what a robot says about the driver: its `params` and `overrides`.
        use: where the robot names it.
    """
    findings = library.findings
    whole = library.whole(document)
    if whole is None:
        return None
    told = len(findings.problems)
    if kind_of(whole) == "driver":
        overrides = given.get("overrides") if given is not None else None
        whole = whole if overrides is None else _overridden(whole, overrides)
        whole = fill_params(
            whole, given.get("params") if given is not None else None, use, findings
        )
    whole = expand(whole, findings)
    known = {_place(problem) for problem in findings}
    shape = [problem for problem in check_shape(whole) if _place(problem) not in known]
    findings.problems += shape
    return None if has_errors(findings.problems[told:]) else whole


def _place(problem: Problem) -> tuple[str, str, int, int]:
    """Return what tells findings apart that came from one text over different ways."""
    return problem.code, problem.file, problem.line, problem.column


def _overridden(document: Document, overrides: Part) -> Document:
    """Return a driver with what a robot changes in it."""
    mark = overrides.document.at(overrides.path)
    if mark is None:
        return document  # a part that is there has a mark
    over = Tree(overrides.data, mark, overrides.document.source_of(overrides.path))
    merged = merge(Tree(document.data, document.mark, document), over)
    mark = document.mark.copy(dict(merged.mark.children))
    return Document(
        document.file, document.text, document.lines, merged.value, mark, document.findings
    )


def _gather_robot(sources: Sources, library: Library) -> None:
    root, findings = sources.root, library.findings
    driver = root.get("driver")
    if driver is not None:
        _check_placement(root, findings)
        sources.driver = _driver(driver, sources, library)
    elif "transports" not in root.data:
        findings.error(
            root,
            "missing-key",
            "'driver' or 'transports' is missing from a robot",
            key=True,
            hint="name a driver's document, or declare the lines to the robot",
        )
    sources.add(root)
    for name, inner in root.named("interfaces").items():
        if isinstance(inner.data, str):
            target = _follow(inner, "interface", library)
            if target is not None:
                sources.interfaces[name] = target
        else:
            sources.interfaces[name] = inner


def _check_placement(root: Part, findings: Findings) -> None:
    """Report what belongs to the driver and stands beside it."""
    for key in read_schema("robot.schema.json")["$defs"]["inlineDriver"]["properties"]:
        if key in root.data:
            findings.error(
                root,
                "misplaced-key",
                f"'{key}' belongs to the driver",
                at=key,
                key=True,
                hint="move it to where 'driver:' points, or write the whole driver here",
            )


def _driver(part: Part, sources: Sources, library: Library) -> Part:
    """Return the driver that stands at `part`, or that it names."""
    reference, given = part, None
    if isinstance(part.data, dict):
        if "use" not in part.data:
            return part  # it stands right here
        reference, given = part.must("use"), part
    followed = _follow(reference, "driver", library, given)
    if followed is None:
        return part
    sources.add(followed)
    return followed


def _follow(reference: Part, kind: str, library: Library, given: Part | None = None) -> Part | None:
    """Return the document that a path names, relative to the document that names it."""
    document = library.follow(reference, (kind,))
    if document is None:
        return None
    shaped = _shaped(document, library, given, reference)
    if shaped is None:
        return None
    if _is_part(shaped):
        library.findings.error(
            reference,
            "partial-document",
            f"{shaped.file} is only a part of {'an' if kind == 'interface' else 'a'} {kind}",
            hint="name a document that includes or extends it",
        )
        return None
    return Part(shaped, (), shaped.data)
