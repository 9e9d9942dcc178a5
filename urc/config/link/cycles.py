"""Searches for cycles: signals that depend on themselves, and sequences that run themselves."""

from collections.abc import Callable, Iterable

__all__ = ["cycle_from"]


def cycle_from(start: str, following: Callable[[str], Iterable[str]]) -> list[str]:
    """Return the shortest path from `start` back to itself; an empty list if there is no cycle.

    Args:
        start: first name of the path.
        following: function that returns the direct dependencies of a name.
    """
    came_from: dict[str, str] = {}
    waiting = [start]
    while waiting:
        name = waiting.pop(0)
        for other in following(name):
            if other == start:
                path = [name]
                while path[-1] != start:
                    path.append(came_from[path[-1]])
                return [*reversed(path), start]
            if other not in came_from:
                came_from[other] = name
                waiting.append(other)
    return []
