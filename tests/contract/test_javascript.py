"""The pages' modules that need no page, tested by Node: ``tests/js/*.test.mjs``."""

import subprocess
from pathlib import Path

import pytest

from scripts.node import node_executable

ROOT = Path(__file__).resolve().parents[2]
FILES = sorted((ROOT / "tests" / "js").glob("*.test.mjs"))
NODE_TIMEOUT_S = 120


def test_there_are_tests() -> None:
    """A folder that is empty by mistake must not pass."""
    assert FILES


@pytest.mark.needs("node")
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name.removesuffix(".test.mjs"))
def test_a_module_does_what_its_tests_say(file: Path) -> None:
    """Every test of the file passes; Node's own report says which did not."""
    node = node_executable()
    assert node is not None
    done = subprocess.run(
        # Not with `--test`, which starts a second Node for the file.
        [node, "--import", "./tests/js/page.mjs", str(file.relative_to(ROOT))],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=NODE_TIMEOUT_S,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
