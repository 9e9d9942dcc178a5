"""Every verb of `urc`: made of the same parts, with help that shows an example, and documented."""

import shlex
from importlib import import_module
from pathlib import Path

import pytest

from urc.cli.arguments import parse, profile_path
from urc.cli.main import VERBS, main, module_of

ROOT = Path(__file__).resolve().parents[2]
CLI = ROOT / "docs" / "reference" / "cli.md"
"""Generated from the verbs themselves."""
PAGES = (ROOT / "README.md", *sorted(set((ROOT / "docs").rglob("*.md")) - {CLI}))


@pytest.mark.parametrize("verb", VERBS)
def test_verb_is_a_module_of_three_parts(verb: str) -> None:
    """An example, its arguments, and what it does; each says in a line what it is."""
    module = import_module(module_of(verb))
    assert module.__doc__
    assert module.__doc__.startswith(f"`urc {verb}`: ")
    for name in ("add_arguments", "run"):
        assert callable(getattr(module, name))
        assert getattr(module, name).__doc__


@pytest.mark.parametrize("verb", VERBS)
def test_example_of_a_verb_can_be_typed(verb: str) -> None:
    """The parser takes it as it stands."""
    module = import_module(module_of(verb))
    program, named, *words = shlex.split(module.EXAMPLE.partition(" > ")[0])
    assert (program, named) == ("urc", verb)
    assert not isinstance(parse(verb, VERBS[verb], module, words), int)


@pytest.mark.parametrize("verb", VERBS)
def test_help_of_a_verb_shows_its_example(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    """It begins with the usage and ends with the example; every option says what it is for."""
    assert main([verb, "--help"]) == 0
    output, errors = capsys.readouterr()
    assert errors == ""
    assert output.startswith(f"usage: urc {verb} ")
    assert output.endswith(f"example:\n  {import_module(module_of(verb)).EXAMPLE}\n")
    lines = output.splitlines()
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if line.startswith("  -"):
            is_told = "  " in line.strip() or following.startswith("    ")
            assert is_told, f"nothing is said of {line.strip()}"


@pytest.mark.parametrize("verb", VERBS)
def test_verb_is_named_in_the_docs(verb: str) -> None:
    """Who reads the pages meets every verb."""
    assert any(f"urc {verb}" in page.read_text(encoding="utf-8") for page in PAGES)


@pytest.mark.parametrize("verb", VERBS)
def test_an_example_names_nothing_that_only_a_checkout_has(
    verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A robot is named as it can be in any folder; other files are the reader's own."""
    monkeypatch.chdir(tmp_path)
    module = import_module(module_of(verb))
    words = shlex.split(module.EXAMPLE.partition(" > ")[0])
    assert not [word for word in words if word.startswith(("robots/", "widgets/", "docs/"))]
    found = parse(verb, VERBS[verb], module, words[2:])
    profiles = [*getattr(found, "profiles", ()), getattr(found, "profile", None)]
    for profile in filter(None, profiles):
        if not profile.endswith(".yaml"):
            assert Path(profile_path(profile)).is_file()
