"""`urc fleet rules`: the rules of this site for visitors from other sites."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from urc.cli.error_report import Misuse
from urc.cli.identities import show
from urc.cli.output import complain
from urc.problems import UrcError, printable

if TYPE_CHECKING:
    from urc.fleet.rules import Applicant, SiteRule, SiteRules
    from urc.model.role import Role

__all__ = ["fleet_rules"]


def fleet_rules(data: Path, arguments: argparse.Namespace) -> int:
    """Print the rules, or what they decide about one visitor; return 1 if they are wrong."""
    from urc.fleet.faults import rules_faults
    from urc.fleet.files import FLEET_FOLDER
    from urc.fleet.membership import Membership
    from urc.fleet.rules_file import RULES_FILE, read_rules

    folder = data / FLEET_FOLDER
    words = arguments.words
    if words and (words[0] != "check" or len(words) != 3):
        raise Misuse("expected 'urc fleet rules' or 'urc fleet rules check NAME@SITE ROBOT'")
    who = _applicant(arguments) if words else None
    own, file = Membership.load(folder), folder / RULES_FILE
    if faults := [*rules_faults(file)]:
        for fault in faults:
            complain(fault)
        complain("urc fleet: the site admits no visitors until the file is correct")
        return 1
    rules = read_rules(file)
    if who is None:
        return _list(rules, file, arguments)
    return _check(rules, who, own.site, arguments)


def _list(rules: "SiteRules", file: Path, arguments: argparse.Namespace) -> int:
    from urc.fleet.rules import OPEN

    rows: list[dict[str, object]] = []
    table: list[tuple[str, ...]] = [
        ("RULE", "ROLE", "SITES", "PEOPLE", "NETWORKS", "ROBOTS", "TIMES")
    ]
    for one in rules.rules:
        rows.append(_row(one))
        lists = (one.sites, one.people, one.networks, one.robots)
        shown = (", ".join(sorted(map(str, each))) or "all" for each in lists)
        table.append((one.name, _word(one.role), *shown, one.times or "always"))
    rows.append({"name": "", "role": _word(rules.otherwise), "time_zone": rules.zone_name})
    table.append(("(otherwise)", _word(rules.otherwise), *["all"] * 4, "always"))
    show(rows, table, arguments, "")
    if rules is OPEN:
        complain(f"urc fleet: there is no file {file}, so visitors from all sites may drive")
    elif rules.zone_name:
        complain(f"urc fleet: the time zone is {rules.zone_name}")
    return 0


def _row(rule: "SiteRule") -> dict[str, object]:
    from urc.fleet.rules import DAYS

    return {
        "name": rule.name,
        "role": _word(rule.role),
        "sites": sorted(rule.sites),
        "people": sorted(rule.people),
        "networks": [*map(str, rule.networks)],
        "robots": sorted(rule.robots),
        "days": [DAYS[one] for one in sorted(rule.days)],
        "hours": [*map(str, rule.hours)],
    }


def _check(rules: "SiteRules", who: "Applicant", site: str, arguments: argparse.Namespace) -> int:
    found = rules.decided(who, "drive", time.time(), site)
    rule = f"the rule “{found.rule}”" if found.rule else "no rule applies, so “otherwise” decides"
    row = {"role": _word(found.role), "rule": found.rule, "reason": found.reason}
    if arguments.format == "json":
        show([row], [], arguments, "")
    else:
        print(printable(f"{_word(found.role)}: {found.reason or rule}"))
    return 0


def _applicant(arguments: argparse.Namespace) -> "Applicant":
    import ipaddress

    from urc.fleet.names import site_name
    from urc.fleet.rules import Applicant

    _, person, robot = arguments.words
    name, at, site = person.rpartition("@")
    if not at or not name:
        raise Misuse(f"expected NAME@SITE, such as 'Ann@north-hall', found {person!r}")
    try:
        if arguments.device:
            ipaddress.ip_address(arguments.device)
    except ValueError:
        raise UrcError(
            f"--device: expected a network address such as 192.168.1.20, found"
            f" {arguments.device[:80]!r}"
        ) from None
    tags = tuple(arguments.tag)
    return Applicant(site_name(site), name, arguments.guest, arguments.device, robot, tags)


def _word(role: "Role | None") -> str:
    return role or "none"
