"""The first passes: read a document and check its shape, then those that it refers to.

The result says, for each part of a profile, in which document it stands: a robot may keep its
driver and its interfaces in files of their own.
"""

import os
from typing import Final

from urc.config.part import Findings, Part
from urc.config.shape import check_shape, kind_of
from urc.problems import Problem, ProblemsError, has_errors
from urc.source import read_document, similar_file

__all__ = ["Sources", "gather"]

_DRIVER_KEYS: Final = ("transports", "signals", "messages", "commands", "polls")
_FILE_CODES: Final = (
    "no-such-file", "is-directory", "not-a-file", "not-readable", "too-large",
)  # fmt: skip
_ARTICLES: Final = {"interface": "an interface"}


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

    def add(self, part: Part) -> None:
        """Take what `part` says beside its wire; it goes before what was there."""
        self.settings |= part.named("settings")
        for slot, use in part.named("widgets").items():
            self.slots.setdefault(slot, []).append(use)
        self.tests += part.listed("tests")
        self.simulator |= part.named("simulator")


def gather(path: str) -> tuple[Sources | None, list[Problem]]:
    """Return where everything is, or None with the errors that stop here."""
    try:
        document = read_document(path)
    except ProblemsError as error:
        return None, list(error.problems)
    problems = [*document.findings, *check_shape(document)]
    if has_errors(problems):
        return None, problems
    root = Part(document, (), document.data)
    kind = kind_of(document)
    sources = Sources(root, kind)
    findings = Findings()
    if kind == "robot":
        _gather_robot(sources, findings)
    elif kind == "driver":
        sources.add(root)
    problems += findings
    return (None if has_errors(problems) else sources), problems


def _gather_robot(sources: Sources, findings: Findings) -> None:
    root = sources.root
    driver = root.get("driver")
    here = [key for key in _DRIVER_KEYS if key in root.data]
    if driver is not None:
        for key in here:
            findings.error(
                root,
                "misplaced-key",
                f"'{key}' belongs to the driver",
                at=key,
                key=True,
                hint="move it to where 'driver:' points, or write the whole driver here",
            )
        followed = driver
        if isinstance(driver.data, str):
            followed = _follow(driver, "driver", findings) or driver
            if followed is not driver:
                sources.add(followed)
        sources.driver = followed
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
            target = _follow(inner, "interface", findings)
            if target is not None:
                sources.interfaces[name] = target
        else:
            sources.interfaces[name] = inner


def _follow(reference: Part, kind: str, findings: Findings) -> Part | None:
    """Return the document that a path names, relative to the document that names it."""
    here = reference.document.file
    target = os.path.normpath(os.path.join(os.path.dirname(here), reference.data))
    if os.path.realpath(target) == os.path.realpath(here):
        findings.error(reference, "refers-to-itself", "this document refers to itself")
        return None
    try:
        document = read_document(target)
    except ProblemsError as error:
        first = error.problems[0]
        if first.code in _FILE_CODES:
            near = similar_file(target) if first.code == "no-such-file" else ""
            hint = os.path.join(os.path.dirname(reference.data), near) if near else ""
            findings.error(
                reference,
                first.code,
                f"{target}: {first.message}",
                hint=f"did you mean '{hint}'?" if hint else "",
            )
        else:
            findings.problems += error.problems
        return None
    found = kind_of(document)
    if found and found != kind:
        findings.error(
            reference,
            "wrong-kind",
            f"{target} is {_ARTICLES.get(found, f'a {found}')},"
            f" {_ARTICLES.get(kind, f'a {kind}')} is expected here",
        )
        return None
    problems = [*document.findings, *check_shape(document)]
    findings.problems += problems
    return None if has_errors(problems) else Part(document, (), document.data)
