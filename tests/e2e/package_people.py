"""People with data folders of their own, who run `urc` within the test's process: that is quick."""

from pathlib import Path

import pytest

from urc.cli.main import main

__all__ = ["Person"]


class Person:
    """Somebody with a data folder."""

    def __init__(
        self, folder: Path, capsys: pytest.CaptureFixture[str], patch: pytest.MonkeyPatch
    ) -> None:
        self.folder = folder
        self.complaints = ""
        """What was printed last on standard error."""
        self._capsys = capsys
        self._patch = patch

    def does(self, *words: str, code: int = 0) -> str:
        """Run `urc`; return what it printed, of a failure what it complained of."""
        self._capsys.readouterr()
        self._patch.setenv("URC_DATA_DIR", str(self.folder))
        found = main(words)
        said = self._capsys.readouterr()
        self.complaints = said.err
        assert found == code, said.err
        return said.out if code == 0 else said.err

    def refuses(self, *words: str) -> str:
        """Run what must fail; see that it is told in one line, and the store the same."""
        before = self.holds()
        told = self.does(*words, code=1)
        assert told.count("\n") == 1, told
        assert told.startswith("urc ")
        assert "bug in URC" not in told
        assert self.holds() == before
        return told

    def holds(self) -> dict[str, bytes]:
        """Return every file of the data folder, except the audit log and the kept indexes."""
        return {
            str(file.relative_to(self.folder)): file.read_bytes()
            for file in self.folder.rglob("*")
            if file.is_file()
            and "repositories" not in file.parts
            and file.name != "changing"
            and not file.name.startswith("audit.sqlite")
        }
