"""Processor time, memory and network use of running processes, from ``/proc``."""

import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

__all__ = ["carried_bytes", "cpu_s", "own_mb", "resident_mb", "spent_s"]

_TICKS_HZ = os.sysconf("SC_CLK_TCK")
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


def cpu_s(processes: Iterable[int]) -> dict[int, float]:
    """Return the total processor time of each running process."""
    # Skip the name, which can contain spaces; the words begin with field 3 (see proc(5)).
    stats = {one: _read(one, "stat").rpartition(")")[2].split() for one in processes}
    return {
        one: (int(words[11]) + int(words[12])) / _TICKS_HZ for one, words in stats.items() if words
    }


def spent_s(before: Mapping[int, float], after: Mapping[int, float]) -> float:
    """Return the processor time between two measurements; ended processes do not count."""
    return sum(total_s - before.get(one, 0.0) for one, total_s in after.items())


def resident_mb(process: int) -> float:
    """Return a process's resident memory."""
    pages = _read(process, "statm").split()[1:2]
    return sum(map(int, pages)) * _PAGE_BYTES / 1e6


def own_mb(process: int) -> float:
    """Return a process's memory, including its proportional share of shared memory (PSS)."""
    words = re.search(r"(?m)^Pss: +(\d+) kB", _read(process, "smaps_rollup"))
    return int(words[1]) * 1024 / 1e6 if words else 0.0


def carried_bytes(process: int, device: str) -> tuple[int, int]:
    """Return the received and sent bytes of a network interface in a process's namespace."""
    words = re.search(rf"(?m)^ *{device}: *(.*)$", _read(process, "net/dev"))
    counts = words[1].split() if words else ["0"] * 16
    return int(counts[0]), int(counts[8])


def _read(process: int, name: str) -> str:
    try:
        return Path(f"/proc/{process}/{name}").read_text("utf-8", errors="replace")
    except OSError:  # it has ended
        return ""
