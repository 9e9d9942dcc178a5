"""The ways to install URC that are tried are those in the table of the page."""

import re

import pytest

from scripts.install_trials import ROOT, TRIALS, WHEEL, Trial

PAGE = (ROOT / "docs" / "install" / "index.md").read_text("utf-8")


@pytest.mark.parametrize("trial", TRIALS, ids=[trial.name for trial in TRIALS])
def test_each_trial_has_a_row_in_the_table(trial: Trial) -> None:
    assert re.search(rf"^\| {re.escape(trial.name)}[,| ]", PAGE, re.MULTILINE)


def test_the_three_commands_are_those_of_the_page() -> None:
    """Word for word, with the page's name of the wheel."""
    first = TRIALS[0]
    for command in (*first.install.split(" && "), f"{first.urc} demo"):
        assert f"\n{command.replace(' -q', '')}\n" in PAGE
    assert WHEEL in PAGE
