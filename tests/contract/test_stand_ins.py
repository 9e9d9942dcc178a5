"""What browsers lack is replaced without a difference: the same reports, and a TurtleBot to drive.

A process of its own hides the compiled modules and installs the stand-ins, as the playground's
worker does. `tests/e2e/test_playground.py` does the same in a browser.
"""

import json
import subprocess
import sys
from pathlib import Path

from tests.contract.test_broken_documents import DOCUMENTS, expected_file
from tests.effort import sampled

ROOT = Path(__file__).resolve().parents[2]
_START = """
import json, os, sys
sys.path.insert(0, os.getcwd())
from playground.stand_ins import HIDDEN, install
install()
"""
_REPORTS = f"""{_START}
from tests.contract.test_broken_documents import BROKEN, report
os.chdir(BROKEN)
found = {{document: report(document) for document in sys.argv[1:]}}
loaded = sorted(HIDDEN & sys.modules.keys())
print(json.dumps([found, loaded, sys.modules["rpds"].__file__]))
"""
_TURTLEBOT = f"""{_START}
from playground.checker import check
text = open("robots/turtlebot4.yaml", encoding="utf-8").read()
print(check(text, sys.argv[1]))
"""
_DRIVE = f"""{_START}
import asyncio
from pathlib import Path
from tests.e2e.unhurried import unhurried
from tests.playground_robot import drive
text = open("robots/turtlebot4.yaml", encoding="utf-8").read()
with unhurried():
    print(json.dumps(asyncio.run(drive(text, Path(sys.argv[1])))))
"""


def run(script: str, *arguments: str) -> object:
    """Run a script with the stand-ins; return what it prints as JSON."""
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments],
        cwd=ROOT, capture_output=True, text=True, timeout=110, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


def test_every_broken_document_gives_the_same_report() -> None:
    """To the last letter, and without any of the compiled modules."""
    documents = sampled(DOCUMENTS, 60)
    found, loaded, rpds = run(_REPORTS, *documents)  # type: ignore[misc]
    assert loaded == []
    assert Path(rpds).parent.name == "stand_ins"
    assert len(found) == len(documents) > 0
    expected = {one: expected_file(one).read_text("utf-8") for one in documents}
    assert {one for one in documents if found[one] != expected[one]} == set()


def test_the_dialogues_of_the_turtlebot_pass(tmp_path: Path) -> None:
    """The document's own tests run in the real engine."""
    report = run(_TURTLEBOT, str(tmp_path))
    assert isinstance(report, dict)
    assert (report["problems"], report["tests"]["failed"]) == ([], 0)
    assert report["tests"]["run"] >= 10


def test_the_turtlebot_is_driven_let_go_and_stopped(tmp_path: Path) -> None:
    """Over the page's own protocol, with a session and an emulated robot in the same process."""
    told = run(_DRIVE, str(tmp_path))
    assert isinstance(told, dict)
    assert told["picture"] == "image/png"
    assert told["shows_edit"], "a page after an edit shows the earlier robot"
    assert told["driven_m_s"] > 0.05
    assert told["pictures_later"] > 1
    assert told["let_go_m_s"] == 0.0
    assert told["latched"] is True
    assert told["refused_after_stop"] is True
    assert told["stopped_m_s"] == 0.0
