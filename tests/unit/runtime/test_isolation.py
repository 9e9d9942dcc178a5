"""A stranger's document is looked at by another process, which has little memory and time."""

from pathlib import Path

import pytest

from tests.unit.packages.made import DOCUMENTS, write_package
from urc._translatable import Phrase
from urc.problems import ProblemsError, UrcError
from urc.runtime import isolation
from urc.runtime.isolation import PreviewWorker, look_apart
from urc.runtime.package_preview import look
from urc.web import words
from urc.web.words import spoken


def test_it_sees_what_the_same_process_would_see(tmp_path: Path) -> None:
    """Lines that can still be said in another language, too."""
    document = write_package(tmp_path, "driver", "puppet") / "driver.yaml"
    there, here = look_apart(document, tmp_path, []), look(document, tmp_path, [])
    assert there == here
    line = next(one for one in there.permissions if one.startswith("connects"))
    assert isinstance(line, Phrase)
    token = words.language.set("de")
    try:
        assert spoken(line) == spoken(here.permissions[there.permissions.index(line)]) != line
    finally:
        words.language.reset(token)


def test_what_is_wrong_comes_through(tmp_path: Path) -> None:
    text = DOCUMENTS["driver"].replace("type: integer", "type: pigeon")
    document = write_package(tmp_path, "driver", "puppet", text=text) / "driver.yaml"
    with pytest.raises(ProblemsError) as caught:
        look_apart(document, tmp_path, [])
    assert caught.value.problems[0].line == 14


def test_a_look_takes_no_longer_than_it_may(tmp_path: Path) -> None:
    document = write_package(tmp_path, "driver", "puppet") / "driver.yaml"
    with pytest.raises(UrcError, match=r"driver.yaml: the preview took longer than 0.01 s"):
        look_apart(document, tmp_path, [], total_s=0.01)


def test_a_look_that_ends_without_words_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where the system ends it, since it wanted too much."""
    monkeypatch.setattr(isolation, "COMMAND", ("-c", "import os; os.abort()"))
    document = write_package(tmp_path, "driver", "puppet") / "driver.yaml"
    with pytest.raises(UrcError, match=r"the preview needs more than 30 s of processor time"):
        look_apart(document, tmp_path, [])


def test_each_document_is_looked_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    document = write_package(tmp_path, "driver", "puppet") / "driver.yaml"
    looks = PreviewWorker()
    first = looks(document, tmp_path, [])
    monkeypatch.setattr(isolation, "COMMAND", ("-c", "raise SystemExit(1)"))
    assert looks(document, tmp_path, []) is first
