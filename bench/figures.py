"""Results of a run: printed as lines of JSON, and optionally written into the documentation.

`./dev bench --full --write-docs` writes the results into docs/motion-measurements.md and
docs/performance.md, between the HTML comments that mark each result's place.
"""

import json
from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path

__all__ = ["PAGES", "distribution", "tell", "told", "write_docs"]

_DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGES = (_DOCS / "motion-measurements.md", _DOCS / "performance.md")
BARS = 40
"""Longest bar of a histogram, in characters."""

_UNITS = {"ms": "ms", "us": "us", "mb": "MB", "hz": "Hz"}
"""Unit to show in a column's title, keyed by the suffix of the column's name."""

told: list[dict[str, object]] = []
"""Results of all benchmarks in this run, for the documentation."""


def tell(figures: Mapping[str, object]) -> None:
    """Print and store one result."""
    told.append(dict(figures))
    print(json.dumps(figures), flush=True)


def distribution(times_ms: Sequence[float], bin_ms: float) -> dict[str, object]:
    """Return quantiles and a histogram of times.

    The histogram maps lower bounds in ms to counts.
    """
    times = sorted(one for one in times_ms if one < inf)
    if not times:
        return {}
    last = len(times) - 1
    bins: dict[str, int] = {}
    for time_ms in times:
        name = f"{int(time_ms // bin_ms) * bin_ms:g}"
        bins[name] = bins.get(name, 0) + 1
    return {
        "min_ms": round(times[0], 1),
        "p50_ms": round(times[last // 2], 1),
        "p99_ms": round(times[round(last * 0.99)], 1),
        "max_ms": round(times[-1], 1),
        "histogram_ms": bins,
    }


def write_docs(pages: Sequence[Path] = PAGES) -> None:
    """Write this run's results into the docs pages; leave other benchmarks' results unchanged."""
    texts = {page: page.read_text("utf-8") for page in pages}
    for kind in sorted({str(one["figure"]) for one in told if "figure" in one}):
        rows = [one for one in told if one.get("figure") == kind]
        begin, end = f"<!-- figures: {kind} -->", "<!-- end -->"
        page = next((page for page, text in texts.items() if begin in text), None)
        if page is None:
            raise SystemExit(f"bench: no page contains the mark {begin!r}")
        before, _, rest = texts[page].partition(begin)
        texts[page] = f"{before}{begin}\n{_section(rows)}{end}{rest.partition(end)[2]}"
    for page, text in texts.items():
        page.write_text(text, "utf-8")


def _section(rows: Sequence[Mapping[str, object]]) -> str:
    columns = [name for name in rows[0] if name not in ("figure", "histogram_ms")]
    lines = [f"| {' | '.join(_title(name) for name in columns)} |"]
    lines.append("|---" * len(columns) + "|")
    lines += [f"| {' | '.join(_cell(row.get(name, '')) for name in columns)} |" for row in rows]
    drawn = [_drawing(row, columns[0]) for row in rows if row.get("histogram_ms")]
    return "\n".join(lines) + "\n" + "".join(f"\n```text\n{one}```\n" for one in drawn)


def _title(name: str) -> str:
    words, _, unit = name.rpartition("_")
    title = words if unit in _UNITS else name
    return title.replace("_", " ") + (f", {_UNITS[unit]}" if unit in _UNITS else "")


def _cell(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "–"
    return str(value)


def _drawing(row: Mapping[str, object], name: str) -> str:
    bins = row["histogram_ms"]
    assert isinstance(bins, dict)
    most = max(bins.values())
    wide = max(len(start) for start in bins)
    lines = [f"{row[name]}: lower bound in ms, count"]
    for start, count in bins.items():
        lines.append(f"{start:>{wide}} {'█' * max(1, round(count / most * BARS))} {count}")
    return "\n".join(lines) + "\n"
