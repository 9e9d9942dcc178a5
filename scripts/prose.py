"""Check the English in docs, docstrings and user-visible strings.

    python -m scripts.prose                 fail where a file has more hits than its baseline
    python -m scripts.prose docs urc/motion list every hit below these paths
    python -m scripts.prose --update        write the baseline after hits were reworded or moved

The rules keep sentences short and plain: subject and verb first, nouns instead of relative clauses,
and the words of docs/glossary.md. The baseline contains the number of remaining hits, by file and
rule. `--update` refuses a larger total for a rule, so hits can move between files, but the total
can't grow. `--update` also repairs the baseline after a merge conflict.
"""

import argparse
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from scripts.passages import Sentence, is_read, passages, sentences

ROOT = Path(__file__).resolve().parents[1]
BASELINE = Path(__file__).with_name("prose_baseline.txt")
GLOSSARY = "docs/glossary.md"
FOLDERS = ("docs", "urc", "bench", "scripts", "schemas", "templates", "widgets", "robots")
MOST_WORDS = 25

_VERBS = (
    "is|was|are|were|be|has|had|does|did|comes|came|goes|went|stands|stood|happens|happened|"
    "becomes|became|moves|moved|waits|waited|belongs|remains|follows|cannot|can|may|must|might"
)
RULES: Mapping[str, re.Pattern[str]] = {
    "anew": re.compile(r"\banew\b", re.IGNORECASE),
    "beside": re.compile(r"\bbeside\b", re.IGNORECASE),
    "belongs-into": re.compile(r"\bbelong(?:s|ed)? into\b", re.IGNORECASE),
    "is-none": re.compile(r"\b(?:is|are|was|were) none\b", re.IGNORECASE),
    "tells-of": re.compile(r"\b(?:tells?|telling|told) of\b", re.IGNORECASE),
    "whoever": re.compile(r"\b(?:who|what)ever\b", re.IGNORECASE),
    "somebody": re.compile(r"\b(?:some|no|every|any)body\b", re.IGNORECASE),
    "who-subject": re.compile(r"^[(\"“*]*(?:Who|What|Whose|Of which|Of whom)\s(?!.*\?)"),
    "what-clause": re.compile(rf"(?<!^)\bwhat (?:{_VERBS})\b(?!.*\?)"),
}
"""Pattern for the hits of each rule, except the rules `long` and `glossary`."""

_CODE = re.compile(r"(`+).+?\1")
_LETTER = re.compile(r"[A-Za-z0-9{]")
_ROW = re.compile(r"^(\S+) (\S+) (\d+)$", re.MULTILINE)


class Hit(NamedTuple):
    """A hit: a sentence that breaks a rule."""

    rule: str
    sentence: Sentence

    def __str__(self) -> str:
        place = f"{self.sentence.path}:{self.sentence.line}"
        return f"{place}: {self.rule}: {self.sentence.text}"


def main() -> int:
    """Check the prose, list hits or update the baseline; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m scripts.prose", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("paths", nargs="*", help="list every hit below these paths")
    parser.add_argument("--update", action="store_true", help="write the baseline")
    options = parser.parse_args()
    files = read_files()
    found = list(hits(files, words_of(files[GLOSSARY])))
    if options.paths:
        chosen = [hit for hit in found if hit.sentence.path.startswith(tuple(options.paths))]
        print("\n".join([*map(str, chosen), f"{len(chosen)} hits"]))
        return 0
    allowed = counts_in(BASELINE.read_text("utf-8")) if BASELINE.exists() else None
    if options.update:
        return update(found, allowed)
    return check(found, allowed or Counter())


def read_files() -> dict[str, str]:
    """Return the path and text of every file with prose."""
    found = [*ROOT.glob("*.md"), *ROOT.glob("*.py"), ROOT / "dev"]
    found += [file for folder in FOLDERS for file in (ROOT / folder).rglob("*") if file.is_file()]
    paths = {file.relative_to(ROOT).as_posix(): file for file in found}
    return {path: file.read_text("utf-8") for path, file in paths.items() if is_read(path)}


def words_of(glossary: str) -> list[str]:
    """Return the words to be replaced according to the glossary's last table."""
    table = glossary.partition("| instead of |")[2]
    return re.findall(r"^\| ([^|-][^|]*?) \|", table, re.MULTILINE)


def hits(files: Mapping[str, str], replaced: Iterable[str]) -> Iterator[Hit]:
    """Yield every hit in the files, sorted by path."""
    words = "|".join(re.escape(word) for word in replaced)
    glossary = re.compile(rf"\b(?:{words})s?\b", re.IGNORECASE) if words else None
    for passage in passages(files):
        for sentence in sentences(passage):
            text = _CODE.sub("`", sentence.text)
            for rule, pattern in RULES.items():
                if pattern.search(text):
                    yield Hit(rule, sentence)
            if sum(1 for word in text.split() if "`" in word or _LETTER.search(word)) > MOST_WORDS:
                yield Hit("long", sentence)
            if glossary and sentence.path != GLOSSARY and glossary.search(text):
                yield Hit("glossary", sentence)


def check(found: list[Hit], allowed: Counter[tuple[str, str]]) -> int:
    """Print the files that have more hits than the baseline allows; return the exit code."""
    counted = counts(found)
    over = {key for key, count in counted.items() if count > allowed[key]}
    for hit in found:
        if (hit.sentence.path, hit.rule) in over:
            print(hit)
    for path, rule in sorted(over):
        print(f"{path}: {rule}: {counted[path, rule]} hits, {allowed[path, rule]} in the baseline")
    fewer = (allowed - counted).total()
    remedy = "; python -m scripts.prose --update lowers the baseline" if fewer and not over else ""
    print(f"prose: {len(found)} hits; the baseline allows {fewer} more in some files{remedy}")
    return 1 if over else 0


def update(found: list[Hit], allowed: Counter[tuple[str, str]] | None) -> int:
    """Write the baseline, unless the total of a rule has increased; return the exit code."""
    totals = Counter(hit.rule for hit in found)
    before: Counter[str] = Counter()
    for (_, rule), count in (allowed or {}).items():
        before[rule] += count
    grown = {} if allowed is None else {rule: totals[rule] - before[rule] for rule in totals}
    for rule in sorted(rule for rule, more in grown.items() if more > 0):
        print(f"prose: {rule}: {grown[rule]} more hits than in the baseline", file=sys.stderr)
    if any(more > 0 for more in grown.values()):
        return 1
    rows = (f"{path} {rule} {count}\n" for (path, rule), count in sorted(counts(found).items()))
    BASELINE.write_text("".join(rows), encoding="utf-8")
    return 0


def counts(found: Iterable[Hit]) -> Counter[tuple[str, str]]:
    """Return the number of hits for each file and rule."""
    return Counter((hit.sentence.path, hit.rule) for hit in found)


def counts_in(baseline: str) -> Counter[tuple[str, str]]:
    """Return the number of hits that a baseline allows for each file and rule.

    If a merge left two rows for the same file and rule, use the larger count.
    """
    found: Counter[tuple[str, str]] = Counter()
    for path, rule, count in _ROW.findall(baseline):
        found[path, rule] = max(found[path, rule], int(count))
    return found


if __name__ == "__main__":
    raise SystemExit(main())
