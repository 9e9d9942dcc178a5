"""Memory, processor time and traffic of a fleet of ten sites, with delay and loss between them.

Ten sites with five robots each, a router and two dashboards run in network namespaces of their own.
Each robot sends 20 signals a hundred times a second, so the sites receive 5,000 frames a second.
Alarms keep all robots connected. A dashboard shows the five robots of one site, another dashboard
those of a second site. The other eight sites are not shown: their interfaces count the bytes that
their presence needs. The robots' programs and the relay are not part of a fleet, and are listed
separately.
"""

import json
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from statistics import mean

from bench.figures import tell
from bench.harness import Result
from bench.kept import Kept
from bench.rig.many_sites import FleetSize, ManySites, Use
from bench.rig.programs import Program, can_relay

__all__ = ["run"]

SMALL = FleetSize(3, 2, 2, 20, 100, 20, 1)
FULL = FleetSize(10, 5, 2, 20, 100, 20, 1)
SIZES_IF_FULL = (FULL, FULL._replace(robots=1), FULL._replace(rate_hz=10))
"""Sizes to measure with `full`; the differences are the costs of a robot and of a frame."""
LOOK_S, LOOK_IF_FULL_S = 5.0, 10.0
FORGOTTEN_S = 12.0
"""Time after which a closed menu is forgotten, in seconds."""
SETTLE_S = 3.0
TIMES_PRESENCE = 1.3
"""Largest ratio of the bytes of a site that is not shown, with and without pages of other sites."""
PHASES = ("no page", "pages of two sites", "pages and menus")


def run(*, full: bool) -> Sequence[Result]:
    """Measure one fleet, or several with `full`; store the rows of each."""
    if not can_relay():
        print(json.dumps({"left_out": "fleet_size: needs root and /dev/net/tun"}))
        return []
    sizes = SIZES_IF_FULL if full else (SMALL,)
    kept = Kept("fleet_size-full" if full else "fleet_size")
    done = {row["size"] for row in kept.rows}
    for size in sizes:
        if _name(size) not in done:
            with (
                tempfile.TemporaryDirectory(prefix="urc-bench-") as folder,
                ManySites(Path(folder), size) as fleet,
            ):
                rows = _measured(fleet, LOOK_IF_FULL_S if full else LOOK_S)
            kept.add({"size": _name(size), "rows": rows})
    found = kept.end()
    rows = [row for one in found for row in one["rows"]]  # type: ignore[attr-defined]
    for row in rows:
        tell({"figure": "fleet_size", **row})
    return [_result(rows[: len(PHASES)])]


def _name(size: FleetSize) -> str:
    return f"{size.sites} × {size.robots}, {size.rate_hz:g} Hz"


def _measured(fleet: ManySites, look_s: float) -> list[dict[str, object]]:
    rows = []
    time.sleep(FORGOTTEN_S)
    with ExitStack() as stack:
        rows.append(_row(PHASES[0], fleet, fleet.used(look_s)))
        pages = [
            stack.enter_context(fleet.pages(dashboard, site))
            for dashboard, site in zip(fleet.dashboards, fleet.sites, strict=False)
        ]
        rows.append(_watched(PHASES[1], fleet, pages, look_s))
        for dashboard in fleet.dashboards:
            stack.enter_context(fleet.menu(dashboard))
        rows.append(_watched(PHASES[2], fleet, pages, look_s))
    return rows


def _watched(
    phase: str, fleet: ManySites, pages: Sequence[Program], look_s: float
) -> dict[str, object]:
    time.sleep(SETTLE_S)
    before, began_s = _frames(pages), time.monotonic()
    row = _row(phase, fleet, fleet.used(look_s))
    count = len(pages) * fleet.size.robots
    row["page_hz"] = round((_frames(pages) - before) / (time.monotonic() - began_s) / count, 1)
    return row


def _frames(pages: Sequence[Program]) -> int:
    total = 0
    for program in pages:
        had = len(program.lines)
        program.order("")
        program.wait_until(lambda: len(program.lines) > had, 30.0, "counts")  # noqa: B023
        total += sum(frames for frames, _ in json.loads(program.lines[-1]))
    return total


def _row(phase: str, fleet: ManySites, used: Mapping[str, Use]) -> dict[str, object]:
    shown = len(fleet.dashboards)
    seen = [used[one.name] for one in fleet.sites[:shown]]
    unseen = [used[one.name] for one in fleet.sites[shown:]]
    screens = [used[one.name] for one in fleet.dashboards]
    router = used[fleet.router.name]
    generators = [one for name, one in used.items() if name.startswith("robots ")]
    return {
        "sites": _name(fleet.size),
        "open": phase,
        "site core": round(mean(one.core for one in unseen), 3),
        "site_mb": round(mean(one.mb for one in unseen), 1),
        "shown site core": round(mean(one.core for one in seen), 3),
        "router core": round(router.core, 3),
        "router_mb": round(router.mb, 1),
        "dashboard core": round(mean(one.core for one in screens), 3),
        "dashboard_mb": round(mean(one.mb for one in screens), 1),
        "site bytes/s": round(mean(one.sent for one in unseen)),
        "shown site bytes/s": round(mean(one.sent for one in seen)),
        "robots core": round(sum(one.core for one in generators), 2),
        "relay core": round(used["relay"].core, 3),
        "page_hz": "",
    }


def _result(rows: Sequence[Mapping[str, object]]) -> Result:
    """Compare the bytes of sites that are not shown with those of mere presence."""
    presence, shown = (float(str(row["site bytes/s"])) for row in rows[:2])
    return Result(
        name="bytes of a site that is not shown, while others are shown / mere presence",
        ratio=round(shown / presence, 3),
        goal=TIMES_PRESENCE,
        baseline_ms=0.0,
        subject_ms=0.0,
        spread=1.0,
        rounds=1,
    )
