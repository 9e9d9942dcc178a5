"""Print a random sample of sentences from a commit's prose, so that a reader can judge the English.

    python -m scripts.sentences             60 sentences of HEAD
    python -m scripts.sentences COMMIT      of another commit

The random seed is the commit's hash. The same commit therefore produces the same sentences on every
machine, and no one can select favourable sentences. Each sentence of at least four words has the
same probability; identical sentences count once. `scripts/passages.py` defines prose.
"""

import argparse
import io
import random
import subprocess
import tarfile
from collections import Counter
from pathlib import Path

from scripts.passages import FEWEST_WORDS, Sentence, is_read, passages, sentences

ROOT = Path(__file__).resolve().parents[1]
COUNT = 60


def main() -> int:
    """Print the sampled sentences with path and line; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m scripts.sentences", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("commit", nargs="?", default="HEAD", help="commit with the prose to sample")
    commit = _git("rev-parse", "--verify", f"{parser.parse_args().commit}^{{commit}}")
    name = commit.decode().strip()
    found = candidates(files_of(name))
    kinds = Counter(one.kind for one in found)
    parts = ", ".join(f"{kind} {count}" for kind, count in sorted(kinds.items()))
    print(f"{COUNT} of {len(found)} sentences ({parts}), seed {name}\n")
    for number, one in enumerate(draw(found, name), 1):
        print(f"{number:2}. {one.path}:{one.line}\n    {one.text}")
    return 0


def candidates(files: dict[str, str]) -> list[Sentence]:
    """Return all sentences to sample from, sorted by file."""
    found: dict[str, Sentence] = {}
    for passage in passages(files):
        for one in sentences(passage):
            if len(one.text.split()) >= FEWEST_WORDS:
                found.setdefault(one.text, one)
    return list(found.values())


def draw(found: list[Sentence], seed: str, count: int = COUNT) -> list[Sentence]:
    """Return a random sample of `count` sentences, determined by the seed."""
    return random.Random(seed).sample(found, min(count, len(found)))  # noqa: S311  no secret


def files_of(commit: str) -> dict[str, str]:
    """Return the path and text of every file with prose in a commit."""
    with tarfile.open(fileobj=io.BytesIO(_git("archive", "--format=tar", commit))) as archive:
        return {
            member.name: file.read().decode("utf-8")
            for member in archive
            if member.isfile() and is_read(member.name) and (file := archive.extractfile(member))
        }


def _git(*arguments: str) -> bytes:
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, check=True).stdout


if __name__ == "__main__":
    raise SystemExit(main())
