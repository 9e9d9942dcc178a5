"""Update, check and compile the catalogues of the text on the pages.

    python -m scripts.translations            update translations/*.po and compile them
    python -m scripts.translations --check    exit 1 if a catalogue is out of date or has gaps

The translatable text comes from the pages' templates and modules, and from the widgets' templates,
modules, titles and summaries. A message is the text in ``t("...")`` or ``ctx.t("...")``. The
catalogues are gettext PO files, which any translation program can open.
"""

import argparse
import io
import json
import re
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import yaml
from babel.messages.catalog import Catalog, Message
from babel.messages.extract import extract
from babel.messages.pofile import read_po, write_po

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "urc" / "web" / "translations"
TAGS = ("de", "fr", "it")
KEYWORDS: dict[str, None] = dict.fromkeys(
    ("t", "mark", "phrase", "words.t", "ctx.t", "this.t", "this.ctx.t")
)
OPTIONS = {"parse_template_string": True}
IDLE_HEADERS = tuple(
    f'"{name}'
    for name in ("POT-", "PO-", "Project-", "Report-", "Last-", "Language-Team", "Generated-")
)
"""PO file headers to remove, because they depend on the date or on the writing program."""
HOLE = re.compile(r"\{[a-z_]+\}")


def sources() -> Iterator[tuple[str, Path]]:
    """Yield Babel's extraction method and the path of every file with user-visible text."""
    for pattern, method in (
        ("templates/*.j2", "jinja2"),
        ("widgets/*/*.j2", "jinja2"),
        ("widgets/*/*.js", "javascript"),
        ("urc/web/static/**/*.js", "javascript"),
        ("urc/web/**/*.py", "python"),
        ("urc/runtime/package_preview.py", "python"),
        ("urc/packages/*.py", "python"),
    ):
        for path in sorted(ROOT.glob(pattern)):
            yield method, path


@cache
def messages() -> Mapping[str, list[str]]:
    """Return each message with the files that contain it, in order of appearance."""
    found: dict[str, list[str]] = {}
    for method, path in sources():
        with path.open("rb") as stream:
            for _, said, _, _ in extract(method, stream, KEYWORDS, options=OPTIONS):
                place = path.relative_to(ROOT).as_posix()
                for one in (said,) if isinstance(said, str) else said[:1]:
                    if one and place not in found.setdefault(one, []):
                        found[one].append(place)
    for path in sorted(ROOT.glob("widgets/*/widget.yaml")):
        said = yaml.safe_load(path.read_text("utf-8"))
        for text in (said["title"], said["summary"]):
            found.setdefault(text, []).append(path.relative_to(ROOT).as_posix())
    return found


def updated(tag: str, wanted: Mapping[str, list[str]]) -> Catalog:
    """Return the updated catalogue with exactly these messages; keep existing translations."""
    place = FOLDER / f"{tag}.po"
    old = read_po(io.BytesIO(place.read_bytes()), tag) if place.is_file() else Catalog(tag)
    new = Catalog(
        tag,
        header_comment=f"# What pages say ({tag}); `python -m scripts.translations` keeps it.",
        fuzzy=False,
    )
    for text, files in wanted.items():
        known = old.get(text)
        new.add(text, known.string if known else "", [(file, 0) for file in files])
    return new


def faults(tag: str, catalog: Catalog) -> Iterator[str]:
    """Yield the errors: missing translations, and missing or additional placeholders."""
    for message in entries(catalog):
        text, said = str(message.id), str(message.string)
        if not said:
            yield f"{tag}.po: {text!r} is not translated"
        elif set(HOLE.findall(text)) != set(HOLE.findall(said)):
            yield f"{tag}.po: {text!r} and {said!r} have different placeholders"


def entries(catalog: Catalog) -> list[Message]:
    """Return a catalogue's messages, without its header."""
    return [message for message in catalog if message.id]


def written(catalog: Catalog) -> dict[Path, str]:
    """Return the paths and contents of one language's catalogue files."""
    stream = io.BytesIO()
    write_po(stream, catalog, width=100, omit_header=False, include_lineno=False)
    lines = stream.getvalue().decode().splitlines()
    text = "\n".join(line for line in lines if not line.startswith(IDLE_HEADERS)) + "\n"
    words = {str(one.id): str(one.string) for one in entries(catalog) if one.string}
    tag = str(catalog.locale)
    table = json.dumps(words, ensure_ascii=False, indent=0, sort_keys=True) + "\n"
    return {FOLDER / f"{tag}.po": text, FOLDER / f"{tag}.json": table}


def is_same(place: Path, text: str) -> bool:
    """Return whether a file has this content, ignoring the formatting of PO files."""
    if not place.is_file():
        return False
    old = place.read_text(encoding="utf-8")
    if place.suffix == ".json":
        return old == text
    both = (read_po(io.StringIO(one)) for one in (old, text))
    was, now = ({str(one.id): str(one.string) for one in entries(catalog)} for catalog in both)
    return was == now


def main(arguments: list[str] | None = None) -> int:
    """Update or check the catalogues; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--check", action="store_true")
    is_check = parser.parse_args(arguments).check
    wanted = messages()
    wrong: list[str] = []
    for tag in TAGS:
        catalog = updated(tag, wanted)
        wrong += faults(tag, catalog)
        for place, text in written(catalog).items():
            if is_check:
                if not is_same(place, text):
                    wrong.append(f"{place.name} is outdated: run python -m scripts.translations")
            else:
                place.write_text(text, encoding="utf-8")
    for line in wrong:
        print(line)
    return 1 if wrong and is_check else 0


if __name__ == "__main__":
    sys.exit(main())
