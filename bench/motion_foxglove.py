"""Data that a driven robot receives after its Foxglove SDK server is frozen or killed."""

from collections.abc import Sequence

from bench.harness import Result
from bench.troubles import trouble

__all__ = ["run"]


def run(*, full: bool) -> Sequence[Result]:
    """Freeze and kill servers; compare the received data with the limits."""
    return trouble("foxglove", full=full)
