"""The first passes over a document and the documents it refers to: compose, expand and shape.

The compose pass merges a document with the documents under `extends` and `include`. The expand pass
replaces `params` and `each`. The shape pass checks the result against the schema. Each pass handles
one document at a time.

URC reads the robot before the driver and the interfaces, because the robot refers to both.
"""

from typing import NamedTuple

from urc.config.compose.each import expand
from urc.config.compose.inherit import compose, override
from urc.config.compose.library import Library
from urc.config.compose.params import fill_params
from urc.config.node import Node, Problems
from urc.config.schemas import kind_of, read_schema
from urc.config.shape.check import check_shape, check_source
from urc.config.sources import Sources
from urc.problems import Problem, ProblemsError, has_errors
from urc.source import Document

__all__ = ["LoadedSources", "gather"]


class LoadedSources(NamedTuple):
    """The parts of a loaded document and its references, and the problems found so far."""

    sources: Sources | None
    """The parts of the profile; None after an error, and for a partial document."""
    problems: list[Problem]
    kind: str
    files: tuple[str, ...]
    """Paths of all requested files, including missing files."""


def gather(path: str) -> LoadedSources:
    """Return the parts and problems of a document and of the documents it refers to."""
    library = Library()
    try:
        document = library.read(path)
    except ProblemsError as error:
        return LoadedSources(None, list(error.problems), "", tuple(library.files))
    kind = kind_of(document)
    problems = library.problems
    problems.problems += document.problems
    root = _prepared(document, library)
    sources = None
    if root is not None and not _is_part(root):
        sources = Sources(Node(root, (), root.data), kind)
        if kind == "robot":
            _gather_robot(sources, library)
        elif kind == "driver":
            sources.add(sources.root)
    if has_errors(problems):
        sources = None
    found = list(dict.fromkeys(problems))
    return LoadedSources(sources, found, "" if has_errors(found) else kind, tuple(library.files))


def _is_part(document: Document) -> bool:
    return isinstance(document.data, dict) and document.data.get("partial") is True


def _prepared(
    document: Document, library: Library, given: Node | None = None, use: Node | None = None
) -> Document | None:
    """Return the document after the compose, expand and shape passes; None on error.

    `given` is the robot's mapping with `params` and `overrides`. `use` is the robot's reference to
    the driver.
    """
    problems = library.problems
    whole, sources = compose(document, library)
    for source in sources:
        problems.problems += check_source(source)
    if whole is None:
        return None
    told = len(problems.problems)
    if kind_of(whole) == "driver":
        overrides = given.get("overrides") if given is not None else None
        params = given.get("params") if given is not None else None
        if overrides is not None:
            whole = override(whole, overrides)
        whole = fill_params(whole, params, use, problems)
    whole = expand(whole, problems)
    known = {_place(problem) for problem in problems}
    problems.problems += [one for one in check_shape(whole) if _place(one) not in known]
    return None if has_errors(problems.problems[told:]) else whole


def _place(problem: Problem) -> tuple[str, str, int, int]:
    """Return the code, file, line and column, by which two passes recognise the same problem."""
    return problem.code, problem.file, problem.line, problem.column


def _gather_robot(sources: Sources, library: Library) -> None:
    root, problems = sources.root, library.problems
    driver = root.get("driver")
    if driver is not None:
        _check_placement(root, problems)
        sources.driver = _driver(driver, sources, library)
    elif "transports" not in root.data:
        problems.error(
            root,
            "missing-key",
            "a robot needs 'driver' or 'transports'",
            key=True,
            hint="name a driver document, or declare the robot's transports",
        )
    sources.add(root)
    for name, inner in root.named("interfaces").items():
        if isinstance(inner.data, str):
            target = _follow(inner, "interface", library)
            if target is not None:
                sources.interfaces[name] = target
        else:
            sources.interfaces[name] = inner


def _check_placement(root: Node, problems: Problems) -> None:
    """Report driver keys in a robot that refers to a driver's document."""
    for key in read_schema("robot.schema.json")["$defs"]["inlineDriver"]["properties"]:
        if key in root.data:
            problems.error(
                root,
                "misplaced-key",
                f"'{key}' is a key of drivers, not of robots",
                at=key,
                key=True,
                hint="move the key to the driver's document, or write the whole driver here",
            )


def _driver(part: Node, sources: Sources, library: Library) -> Node:
    """Return the driver that `part` declares or refers to."""
    reference, given = part, None
    if isinstance(part.data, dict):
        if "use" not in part.data:
            return part  # declared here
        reference, given = part.must("use"), part
    followed = _follow(reference, "driver", library, given)
    if followed is None:
        return part
    sources.add(followed)
    return followed


def _follow(reference: Node, kind: str, library: Library, given: Node | None = None) -> Node | None:
    """Return the document that `reference` names, after the first passes; None on error."""
    document = library.follow(reference, (kind,))
    if document is None:
        return None
    prepared = _prepared(document, library, given, reference)
    if prepared is None:
        return None
    if _is_part(prepared):
        library.problems.error(
            reference,
            "partial-document",
            f"{prepared.file} is a partial {kind}",
            hint="use a document that includes or extends the partial document",
        )
        return None
    return Node(prepared, (), prepared.data)
