"""The documents that docs/language/reuse.md shows are good ones, and do what it says."""

import re
from pathlib import Path

import pytest

from urc.config.load import check, load_profile
from urc.config.parse.widget import WidgetFolder
from urc.config.resolve import resolve
from urc.runtime.registries import built_in_catalog
from urc.shipped import shipped

PAGE = Path(__file__).resolve().parents[2] / "docs" / "language" / "reuse.md"
_BLOCK = re.compile(r"^```yaml\n# file: (\S+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILES = dict(_BLOCK.findall(PAGE.read_text("utf-8")))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        file = tmp_path / name
        file.parent.mkdir(exist_ok=True)
        file.write_text("# " + name + "\n" + text, "utf-8")
    return tmp_path


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("name", FILES)
def test_document_of_the_page_has_no_finding(name: str) -> None:
    """As `urc validate` sees it, with every document beside it."""
    problems = check(name, built_in_catalog()).problems
    assert [one.headline for one in problems] == []


@pytest.mark.usefixtures("folder")
def test_documents_of_the_page_become_what_it_says() -> None:
    """Ports, limits, polls and signals after all is put together."""
    catalog = built_in_catalog()
    two = load_profile("rover-two.yaml", catalog).driver
    assert two.transports["wire"].options["port"] == 7001
    assert list(two.signals) == ["battery"]
    assert two.signals["battery"].limits.low == 30
    assert [(poll.name, poll.every_s) for poll in two.polls] == [("battery", 2.0)]
    arm = load_profile("arm.yaml", catalog).driver.signals
    assert [(one.name, one.unit) for one in arm.values()] == [
        ("joint_1", "rad"),
        ("joint_2", "rad"),
        ("joint_3", "m"),
        ("base_temperature", "degC"),
        ("tool_temperature", "degC"),
    ]
    assert arm["tool_temperature"].max == 45
    assert load_profile("cart.yaml", catalog).driver.signals["battery"].stale_after_s == 10


@pytest.mark.usefixtures("folder")
def test_what_the_page_shows_of_urc_resolve_is_what_is_printed() -> None:
    """Line by line, with file and line of every key."""
    (shown,) = re.findall(r"^```text\n(.*?)^```$", PAGE.read_text("utf-8"), re.M | re.S)
    assert shown in resolve("gripper.yaml", WidgetFolder(shipped("widgets"))).text
