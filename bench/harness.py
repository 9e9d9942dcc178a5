"""Measurement of ratios: baseline and subject alternate, and the result is the median ratio.

Times depend on the machine's load, but the ratio of two times from the same run hardly does.
"""

import json
import os
import statistics
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field

__all__ = ["Goal", "Result", "compare", "compare_all", "process_seconds", "report"]

PROCESS_TIMEOUT_S = 60


@dataclass(frozen=True, slots=True)
class Goal:
    """A benchmark's goal: the name of a ratio, and the ratio's upper bound."""

    name: str
    """Name of the measured ratio: subject / baseline."""
    at_most: float


@dataclass(frozen=True, slots=True)
class Result:
    """One ratio and its measurements."""

    name: str
    ratio: float
    """Median ratio over all pairs of rounds."""
    goal: float
    baseline_ms: float
    subject_ms: float
    spread: float
    """The baseline's slowest round divided by its median; a value above 2 means a busy machine."""
    rounds: int
    versions: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_met(self) -> bool:
        """Whether the ratio meets its goal."""
        return self.ratio <= self.goal


def process_seconds(command: Sequence[str]) -> float:
    """Run a command to completion and return its wall time in seconds.

    Raises:
        SystemExit: the command failed, or took longer than `PROCESS_TIMEOUT_S`.
    """
    # With this variable set, no bytecode is cached, so the benchmark would measure Python's
    # compiler.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    began = time.perf_counter()
    try:
        subprocess.run(
            command, check=True, capture_output=True, env=environment, timeout=PROCESS_TIMEOUT_S
        )
    except subprocess.SubprocessError as error:
        said = (getattr(error, "stderr", None) or b"").decode(errors="replace").strip()
        raise SystemExit(f"bench: {error}\n{said}") from error
    return time.perf_counter() - began


def compare(
    goal: Goal,
    baseline: Callable[[], float],
    subject: Callable[[], float],
    *,
    rounds: int = 11,
    versions: Mapping[str, str] | None = None,
) -> Result:
    """Measure the baseline and the subject alternately, after one warm-up round."""
    return compare_all([(goal, baseline)], subject, rounds=rounds, versions=versions)[0]


def compare_all(
    baselines: Sequence[tuple[Goal, Callable[[], float]]],
    subject: Callable[[], float],
    *,
    rounds: int = 11,
    versions: Mapping[str, str] | None = None,
) -> list[Result]:
    """Measure a subject and several baselines alternately, after one warm-up round."""
    measured: list[list[float]] = []
    for _ in range(rounds + 1):
        measured.append([*(baseline() for _, baseline in baselines), subject()])
    results: list[Result] = []
    *columns, subjects = zip(*measured[1:], strict=True)
    for (goal, _), bases in zip(baselines, columns, strict=True):
        pairs = zip(bases, subjects, strict=True)
        result = Result(
            name=goal.name,
            ratio=round(statistics.median(after / before for before, after in pairs), 3),
            goal=goal.at_most,
            baseline_ms=round(statistics.median(bases) * 1000, 2),
            subject_ms=round(statistics.median(subjects) * 1000, 2),
            spread=round(max(bases) / statistics.median(bases), 2),
            rounds=rounds,
            versions=versions or {},
        )
        results.append(result)
    return results


def report(results: Sequence[Result]) -> int:
    """Print each result as a line of JSON; return 1 if a goal is missed, otherwise 0."""
    for result in results:
        print(json.dumps({**asdict(result), "met": result.is_met}))
    return int(not all(result.is_met for result in results))
