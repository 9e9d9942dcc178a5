"""The reference page for the command line, generated from `urc`'s argument parsers."""

import argparse
from collections.abc import Iterator
from importlib import import_module

from scripts.reference.markdown import fence
from urc.cli.main import VERBS, module_of

__all__ = ["page", "parser_of"]

# ruff: noqa: SLF001  argparse has no public list of its options

_EXIT = "Exit codes: 0 for success, 1 for problems or failure, 2 for incorrect usage."


def page() -> str:
    """Return the page: one section for each subcommand and each option."""
    lines = ["# Command line", "", "All subcommands of `urc` and their options.", "", _EXIT, ""]
    lines += ["| subcommand | does |", "|---|---|"]
    lines += [f"| [`urc {verb}`](#urc-{verb}) | {text} |" for verb, text in VERBS.items()]
    lines.append("")
    for verb in VERBS:
        lines += _section(f"urc {verb}", parser_of(verb), VERBS[verb])
        example = import_module(module_of(verb)).EXAMPLE
        lines += ["Example:", "", *fence(example)]
    return "\n".join(lines).rstrip() + "\n"


def parser_of(verb: str) -> argparse.ArgumentParser:
    """Return a subcommand's parser."""
    parser = argparse.ArgumentParser(prog=f"urc {verb}", add_help=False)
    import_module(module_of(verb)).add_arguments(parser)
    return parser


def _section(name: str, parser: argparse.ArgumentParser, summary: str) -> Iterator[str]:
    yield from (f"## {name}", "", f"{summary[0].upper()}{summary[1:]}.", "")
    width = argparse.HelpFormatter(prog=name, width=96)
    width.add_usage(parser.usage, parser._actions, parser._mutually_exclusive_groups, prefix="")
    yield from fence(width.format_help().strip())
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            texts = {one.dest: one.help or "" for one in action._choices_actions}
            for inner, sub in action.choices.items():
                yield from _section(f"{name} {inner}", sub, texts.get(inner) or inner)
        else:
            yield from _option(name, action)


def _option(name: str, action: argparse.Action) -> Iterator[str]:
    words = action.option_strings or [_metavar(action)]
    yield from (f"### {name} {words[-1]}", "")
    text = (action.help or "").replace("%%", "%")
    text = f"{text[0].upper()}{text[1:]}" if text else ""
    yield from (f"{text}.", "")
    value = _metavar(action) if action.option_strings and action.nargs != 0 else ""
    written = ", ".join(f"`{word} {value}`" if value else f"`{word}`" for word in words)
    yield f"- written: {written}"
    if action.choices is not None:
        yield f"- allowed: {', '.join(f'`{one}`' for one in action.choices)}"
    if action.option_strings and action.required:
        yield "- required: yes"
    yield ""


def _metavar(action: argparse.Action) -> str:
    if isinstance(action.metavar, str):
        return action.metavar
    if action.choices is not None:
        return "CHOICE"
    return action.dest.upper()
