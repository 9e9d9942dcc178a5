"""The guard loads nothing that works on documents: what is not there cannot hold it up."""

import json
import subprocess
import sys

import pytest

from urc.transports.table import TRANSPORTS

FORBIDDEN = (
    "jinja2",
    "re2",
    "yaml",
    "jsonschema",
    "urc.config",
    "urc.protocol",
    "urc.runtime",
    "urc.web",
    "urc.cli",
)
LOADER = """
import json, sys
import urc.guard.__main__
from urc.transports.table import TRANSPORTS
if sys.argv[1]:
    TRANSPORTS[sys.argv[1]].load()
print(json.dumps(sorted(sys.modules)))
"""


def modules_with(kind: str) -> list[str]:
    """Return the modules of a guard that has a transport of this kind; "": none."""
    command = [sys.executable, "-P", "-c", LOADER, kind]
    done = subprocess.run(command, capture_output=True, check=True, timeout=60, text=True)
    return list(json.loads(done.stdout))


@pytest.mark.cases(4)
@pytest.mark.parametrize("kind", ["", *TRANSPORTS])
def test_guard_has_no_template_pattern_or_parser(kind: str) -> None:
    """Whatever the robot's lines are."""
    loaded = modules_with(kind)
    assert "urc.guard.server" in loaded
    found = [one for one in loaded if any(f"{one}.".startswith(f"{bad}.") for bad in FORBIDDEN)]
    assert found == []
