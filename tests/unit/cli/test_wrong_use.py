"""Options that do not go together, or say nonsense: one line, and nothing is begun."""

from pathlib import Path

import pytest

from urc.cli.main import main

PUPPET = str(Path(__file__).parents[3] / "robots" / "puppet.yaml")
TO = ("--to", "http://127.0.0.1:1/", "--token-file")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("serve", PUPPET, "--fault", "silent"), "--fault is for emulated robots: add --simulate"),
        (("repo", "index", "lab", "--valid", "0"), "expected 1 to 365 days, found '0'"),
        (("repo", "index", "lab", "--valid", "1e3"), "expected 1 to 365 days, found '1e3'"),
        (("repo", "withdraw", "lab", "drivers/x", "1.0.0"), "'urc repo withdraw' requires --why"),
        (("repo", "restore", "lab"), "'urc repo restore' requires DIR PACKAGE VERSION"),
        (("publish", "x", *TO, "{token}", "--commit", "0123abc"), "--commit needs --source"),
        (
            ("publish", "x", *TO, "{token}", "--source", "x"),
            "--source and --commit: expected a source",
        ),
        (
            ("publish", "x", *TO, "{token}", "--source", "https://x.example/", "--commit", "no"),
            "--source and --commit: expected a commit of 7 to 64",
        ),
    ],
)
def test_wrong_use_is_told_in_one_line(
    words: tuple[str, ...],
    told: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Exit code 2."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path))
    token = tmp_path / "token"
    token.write_text("urc_" + "x" * 43)
    assert main([word.replace("{token}", str(token)) for word in words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert told in said.err
    assert said.err.count("\n") == 1
