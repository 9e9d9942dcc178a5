"""Repeat and report trials that measure the time until a robot stops."""

from collections.abc import Callable, Sequence
from math import inf

from bench.figures import distribution, tell
from bench.harness import Result
from bench.kept import Kept
from bench.rig.deaths import Trial

__all__ = ["repeated", "said"]

MOST_BOUTS = 3
"""Maximum number of trial rounds on a busy machine, as a multiple of the required number."""


def repeated(
    death: str, bout: Callable[[], list[Trial]], wanted: int, robot_count: int, kept: Kept
) -> list[Trial]:
    """Repeat rounds until enough trials are valid, or the maximum number of rounds is reached.

    Args:
        death: what makes the robots stop, such as the loss of an operator.
        bout: function that runs one round with all robots.
        wanted: required number of valid trials.
        robot_count: number of trials in one round.
        kept: file of finished trials, from which an interrupted run continues.
    """
    trials = [trial for row in kept.rows if (trial := Trial.of(row)).death == death]
    while len(trials) < MOST_BOUTS * wanted:
        if sum(not one.is_excused for one in trials) >= wanted:
            break
        for trial in bout():
            kept.add(trial._asdict())
            trials.append(trial)
    return trials


def said(figure: str, cause: str, trials: Sequence[Trial], wanted: int, bin_ms: float) -> Result:
    """Print the result for one cause of a stop, and compare the slowest stop with the limit."""
    counted = [one for one in trials if not one.is_excused]
    tell(
        {
            "figure": figure,
            "cause": cause,
            "trials": len(counted),
            "broken": sum(not one.is_good for one in counted),
            "faults": sorted({one.fault for one in counted if one.fault}),
            "excused": len(trials) - len(counted),
            **distribution([one.stop_ms for one in counted], bin_ms),
        }
    )
    is_whole = len(counted) >= wanted and not any(one.fault for one in counted)
    slowest = max((one.stop_ms for one in counted), default=inf) if is_whole else inf
    bound_ms = trials[0].bound_ms
    return Result(
        name=f"motion stop after {cause}: slowest of {len(counted)} / {bound_ms:g} ms",
        ratio=round(slowest / bound_ms, 3),
        goal=1.0,
        baseline_ms=bound_ms,
        subject_ms=round(slowest, 1),
        spread=1.0,
        rounds=len(counted),
    )
