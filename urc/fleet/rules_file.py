"""The file with a site's rules for visitors: reading, checking, and following its changes.

Layer 4. A wrong file refuses all visitors. So does a file that disappears while the server runs,
because editors and mistakes remove files too.
"""

import ipaddress
import logging
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from urc.config.shape.check import check_file
from urc.fleet.rules import DAYS, OPEN, Hours, Network, SiteRule, SiteRules
from urc.model.role import Role
from urc.problems import Problem, ProblemsError, has_errors
from urc.source import Document, DocumentLimits, read_document
from urc.source import Path as DocumentPath

__all__ = ["RULES_FILE", "RulesFile", "read_rules"]

RULES_FILE: Final = "rules.yaml"
"""Name of the file in the folder of the membership."""
_SCHEMA: Final = "site-rules.schema.json"
_LIMITS: Final = DocumentLimits(size_bytes=1 << 18)
_HOURS: Final = re.compile(r"(\d\d):(\d\d)-(\d\d):(\d\d)")
_LISTS: Final = ("sites", "people", "robots")

log = logging.getLogger(__name__)


def read_rules(file: Path) -> SiteRules:
    """Return the rules in a file; `OPEN` if there is no file.

    Raises:
        ProblemsError: the file cannot be read, or contains mistakes.
    """
    try:
        file.lstat()
    except FileNotFoundError:
        return OPEN
    except OSError:  # `read_document` gives the reason
        pass
    document = read_document(str(file), _LIMITS)
    data: Any = document.data
    problems = check_file(document, _SCHEMA)
    if not problems:
        problems = [*_problems(document, data)]
    if has_errors(problems):
        raise ProblemsError(problems)
    return _parsed(data)


class RulesFile:
    """The rules in a file that may change at any time."""

    def __init__(self, file: Path) -> None:
        """Read the file."""
        self.file = file
        self._stamp = _stamp(file)
        self._seen = self._stamp
        self._was_there = self._stamp is not None
        self.rules = self._read()
        """The current rules; wrong rules have a `fault`."""

    def has_changed(self) -> bool:
        """Return whether the file has changed and then stayed the same for one interval of looks.

        A file that is still being written could be valid and allow too much.
        """
        stamp = _stamp(self.file)
        is_settled, self._seen = stamp == self._seen, stamp
        return is_settled and stamp != self._stamp

    def reread(self) -> None:
        """Read the file again; this blocks."""
        self._stamp = self._seen
        self.rules = self._read()

    def _read(self) -> SiteRules:
        try:
            found = read_rules(self.file)
        except ProblemsError as error:
            fault = error.problems[0].headline
        else:
            self._was_there = self._was_there or found is not OPEN
            if found is not OPEN or not self._was_there:
                return found
            fault = f"{self.file}: the file was removed; restore it, or restart the server"
        log.warning("no visitors from other sites are admitted: %s", fault)
        return SiteRules(fault=fault)


def _stamp(file: Path) -> tuple[int, int, int] | None:
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


def _problems(document: Document, data: Mapping[str, Any]) -> Iterator[Problem]:
    """Yield the mistakes that the schema cannot find."""
    rules = data.get("rules", [])
    zone = data.get("time_zone")
    if zone is not None and _zone(zone) is None:
        hint = "write a name such as Europe/Zurich; some systems need the package tzdata"
        text = f"expected the name of a time zone, found {zone!r}"
        yield document.problem(("time_zone",), "wrong-value", text, hint=hint)
    names: set[str] = set()
    for number, rule in enumerate(rules):
        path: DocumentPath = ("rules", number)
        if rule["name"] in names:
            text = f"two rules have the name {rule['name']!r}"
            yield document.problem((*path, "name"), "wrong-value", text, hint="rename one of them")
        names.add(rule["name"])
        timed = next((key for key in ("days", "hours") if key in rule), None)
        if timed and zone is None:
            text = f"{timed!r} requires the key 'time_zone' of the document"
            hint = "add for example: time_zone: Europe/Zurich"
            yield document.problem((*path, timed), "missing-key", text, hint=hint, key=True)
        for place, word in enumerate(rule.get("hours", [])):
            begins, ends = _hours(word)
            if begins == ends:
                text = f"expected an end that differs from the begin, found {word!r}"
                hint = "write 00:00-24:00 for the whole day"
                yield document.problem((*path, "hours", place), "wrong-value", text, hint=hint)
        for place, word in enumerate(rule.get("networks", [])):
            if _network(word) is None:
                text = f"expected an address or a network, found {word!r}"
                hint = "write for example 192.168.1.0/24, without bits after the prefix"
                yield document.problem((*path, "networks", place), "wrong-value", text, hint=hint)


def _parsed(data: Mapping[str, Any]) -> SiteRules:
    zone = data.get("time_zone", "")
    found = SiteRules(otherwise=_role(data["otherwise"]))
    rules = tuple(map(_rule, data.get("rules", [])))
    return SiteRules(rules, found.otherwise, (_zone(zone) if zone else None) or found.zone, zone)


def _rule(data: Mapping[str, Any]) -> SiteRule:
    networks = (_network(one) for one in data.get("networks", []))
    return SiteRule(
        data["name"],
        _role(data["role"]),
        **{key: frozenset(data.get(key, [])) for key in _LISTS},
        networks=tuple(one for one in networks if one is not None),
        days=frozenset(map(DAYS.index, data.get("days", []))),
        hours=tuple(map(_hours, data.get("hours", []))),
    )


def _role(word: str) -> Role | None:
    return "drive" if word == "drive" else "watch" if word == "watch" else None


def _hours(word: str) -> Hours:
    match = _HOURS.fullmatch(word)
    if match is None:  # a line end after the text, which a schema's pattern accepts
        return Hours(0, 0)
    first, second, third, fourth = map(int, match.groups())
    return Hours(first * 60 + second, third * 60 + fourth)


def _network(word: str) -> Network | None:
    try:
        return ipaddress.ip_network(word)
    except ValueError:
        return None


def _zone(name: str) -> ZoneInfo | None:
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        return None
