"""All subcommands in one parser: for completion, the manual page and the reference."""

import argparse

import pytest

from urc.cli.command_tree import command_tree
from urc.cli.completion import SHELLS
from urc.cli.main import GROUPS, VERBS, main


def verbs_of(tree: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    (action,) = (one for one in tree._actions if isinstance(one, argparse._SubParsersAction))
    return dict(action.choices)


def test_each_subcommand_is_in_one_group() -> None:
    grouped = [verb for verbs in GROUPS.values() for verb in verbs]
    assert sorted(grouped) == sorted(VERBS)


def test_tree_has_every_subcommand_with_its_arguments() -> None:
    verbs = verbs_of(command_tree())
    assert verbs.keys() == VERBS.keys()
    assert verbs["demo"].parse_args(["--phone", "--port", "0"]).phone
    assert "example:\n  urc demo" in str(verbs["demo"].epilog)


def test_other_subcommands_are_names_alone() -> None:
    """Completion loads the module of one subcommand."""
    verbs = verbs_of(command_tree({"demo"}))
    assert verbs.keys() == VERBS.keys()
    assert verbs["serve"].description is None
    assert verbs["demo"].description


@pytest.mark.parametrize("shell", SHELLS)
def test_script_of_a_shell_names_the_program(
    shell: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["completion", shell]) == 0
    script, errors = capsys.readouterr()
    assert errors == ""
    assert "urc" in script
    assert "_ARGCOMPLETE" in script
