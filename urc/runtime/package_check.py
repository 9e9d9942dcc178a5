"""Check a package's document for a repository, including its tests.

``python -m urc.runtime.package_check DOCUMENT`` prints the errors as a JSON list. The process
limits its own memory and time, so a third-party document cannot block the repository.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Final

from urc.config.load import check
from urc.problems import Problem, printable
from urc.runtime.document_tests import exercise
from urc.runtime.isolation import bound_this_process
from urc.runtime.registries import built_in_catalog
from urc.runtime.widget_registry import WidgetRegistry
from urc.shipped import shipped

__all__ = ["examine", "examine_apart", "problems"]

_MEMORY_BYTES: Final = 2 << 30
_PROCESSOR_S: Final = 60
_TOTAL_S: Final = 60.0
_FAULTS_MOST: Final = 20
_FAULT_LONGEST: Final = 500


def examine(document: Path) -> list[str]:
    """Return the errors in a package's document as text, one line for each error.

    Args:
        document: path of the document, such as ``TOP/drivers/puppet/driver.yaml``; ``TOP`` also
            contains the required packages.
    """
    top = document.parent.parent.parent
    checked = check(
        document, built_in_catalog(), WidgetRegistry(shipped("widgets"), top / "widgets")
    )
    homes = (top.resolve(), shipped("widgets").resolve())
    outside = [
        f"{document}: the document refers to {file}, which is not in this repository"
        for file in checked.files
        if not any(Path(file).resolve().is_relative_to(home) for home in homes)
    ]
    if outside:
        return outside
    found = [*checked.problems]
    if checked.profile is not None:
        found += exercise(checked.profile).problems
    return [problem.headline for problem in found if problem.severity == "error"]


def problems(document: Path) -> list[Problem]:
    """Return the problems that `urc validate` reports, including failed tests, errors first.

    Args:
        document: path of the document, such as ``TOP/drivers/puppet/driver.yaml``.
    """
    top = document.resolve().parent.parent.parent
    checked = check(
        document, built_in_catalog(), WidgetRegistry(shipped("widgets"), top / "widgets")
    )
    found = [*checked.problems]
    if checked.profile is not None:
        found += exercise(checked.profile).problems
    return sorted(found, key=lambda one: ("error", "warning").index(one.severity))


def examine_apart(document: Path, total_s: float = _TOTAL_S) -> list[str]:
    """Return the errors in a third-party document, found by a separate process with limits.

    Args:
        document: path of the document, as for `examine`.
        total_s: time after which the separate process is killed, in seconds.
    """
    command = [sys.executable, "-P", "-m", "urc.runtime.package_check", str(document)]
    try:
        done = subprocess.run(  # noqa: S603 (our own program)
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=total_s, check=False
        )
    except subprocess.TimeoutExpired:
        return [f"{document}: the check took longer than {total_s:g} s"]
    try:
        faults = [str(fault) for fault in json.loads(done.stdout)]
    except ValueError:
        return [f"{document}: the check exceeded its memory or time limit"]
    return [fault[:_FAULT_LONGEST] for fault in faults[:_FAULTS_MOST]]


def _main(document: str) -> int:
    bound_this_process(_PROCESSOR_S, _MEMORY_BYTES)
    sys.stdout.write(json.dumps([printable(line) for line in examine(Path(document))]))
    return 0


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1]))
