"""`python -m scripts.prose`: what each rule finds, and a baseline that can only shrink."""

from pathlib import Path

import pytest

from scripts import prose

GLOSSARY = (
    "# Glossary\n\n| instead of | write |\n|---|---|\n| garage | factory |\n| dev page | x |\n"
)
TWENTY_FIVE = " ".join(["word"] * 24)


def rules(sentence: str) -> list[str]:
    """Return the rules that a sentence of the documentation breaks."""
    found = prose.hits({"docs/x.md": sentence}, prose.words_of(GLOSSARY))
    return sorted(hit.rule for hit in found)


@pytest.mark.parametrize(
    ("rule", "broken", "plain"),
    [
        ("anew", "Read the file anew.", "Read the file again, as new."),
        ("beside", "The key stands beside the value.", "Besides, it stands next to the value."),
        ("belongs-into", "It belongs into a folder.", "It belongs in a folder."),
        ("is-none", "This is none of the words.", "None of the words is known."),
        ("tells-of", "The log tells of faults.", "The log reports faults."),
        ("tells-of", "Robots are told of it.", "Tell operators to wait."),
        ("whoever", "Stop whoever drives.", "Stop the operator."),
        ("somebody", "Nobody is told.", "No operator is told."),
        ("who-subject", "What comes back is checked.", "The reply is checked."),
        ("who-subject", "Who drives may stop.", "Who may stop?"),
        ("who-subject", "Of which each reading counts.", "Each reading counts."),
        ("what-clause", "Return what is read.", "Return the reply; see what to do."),
        ("what-clause", "See what happened.", "Ask: what happened?"),
        ("glossary", "The garage makes it.", "The `garage` module makes it."),
        ("glossary", "All dev pages.", "All developer pages."),
        ("long", f"Too {TWENTY_FIVE} long.", f"{TWENTY_FIVE} fine."),
        ("long", f"{TWENTY_FIVE} one two.", f"{TWENTY_FIVE} `one code span` — ·."),
    ],
)
def test_each_rule_finds_its_sentence_alone(rule: str, broken: str, plain: str) -> None:
    """A broken sentence breaks one rule; its better form breaks none."""
    assert rules(broken) == [rule]
    assert rules(plain) == []


def test_the_glossary_may_name_the_words_that_it_replaces() -> None:
    """Only that page, and only for that rule."""
    found = prose.hits({prose.GLOSSARY: "A garage. A garage made anew."}, ["garage"])
    assert [hit.rule for hit in found] == ["anew"]


@pytest.fixture
def baseline(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A baseline with two hits in one file."""
    path = tmp_path / "baseline.txt"
    path.write_text("docs/a.md anew 2\n", "utf-8")
    monkeypatch.setattr(prose, "BASELINE", path)
    monkeypatch.setattr("sys.argv", ["prose"])
    return path


def given(monkeypatch: pytest.MonkeyPatch, **files: str) -> None:
    """Let the tree have these pages."""
    tree = {f"docs/{name}.md": text for name, text in files.items()}
    monkeypatch.setattr(prose, "read_files", lambda: {prose.GLOSSARY: GLOSSARY, **tree})


@pytest.mark.parametrize(
    ("text", "code", "says"),
    [
        ("Anew. Anew.", 0, "prose: 2 hits; the baseline allows 0 more"),
        ("Anew.", 0, "prose: 1 hits; the baseline allows 1 more"),
        ("Anew. Anew. Anew.", 1, "docs/a.md: anew: 3 hits, 2 in the baseline"),
        ("Anew. Nobody.", 1, "docs/a.md:1: somebody: Nobody."),
    ],
)
def test_more_hits_than_the_baseline_fail(
    baseline: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    text: str,
    code: int,
    says: str,
) -> None:
    """Each file has its own number for each rule; a failure shows the sentences."""
    given(monkeypatch, a=text)
    assert prose.main() == code
    assert says in capsys.readouterr().out
    assert baseline.read_text("utf-8") == "docs/a.md anew 2\n"


@pytest.mark.parametrize(
    ("files", "code", "after"),
    [
        ({"a": "Anew."}, 0, "docs/a.md anew 1\n"),
        ({"b": "Anew. Anew."}, 0, "docs/b.md anew 2\n"),
        ({"a": "Anew. Anew.", "b": "Anew."}, 1, "docs/a.md anew 2\n"),
        ({"a": "Nobody."}, 1, "docs/a.md anew 2\n"),
    ],
)
def test_the_baseline_only_shrinks(
    baseline: Path, monkeypatch: pytest.MonkeyPatch, files: dict[str, str], code: int, after: str
) -> None:
    """Hits may move to another file, but no rule may have more in all."""
    given(monkeypatch, **files)
    monkeypatch.setattr("sys.argv", ["prose", "--update"])
    assert prose.main() == code
    assert baseline.read_text("utf-8") == after


def test_a_merged_baseline_can_be_read() -> None:
    """Marks of a conflict are skipped, and of two rows the larger counts."""
    merged = "<<<<<<< HEAD\ndocs/a.md anew 2\n=======\ndocs/a.md anew 1\n>>>>>>> other\n"
    assert prose.counts_in(merged) == {("docs/a.md", "anew"): 2}
