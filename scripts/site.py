"""Build the documentation site: `python -m scripts.site`, part of `./dev docs`.

Sphinx reads docs/ and writes .site/html. Warnings are errors: for example, a broken reference, a
page that no table of contents lists, or a heading that skips a level. Sphinx needs no network. If
npm has installed Pyodide, the site contains the playground; the first build downloads and caches
one package for it.
"""

import shutil
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

__all__ = ["HTML", "build"]

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / ".site"
HTML = FOLDER / "html"
PROCESSES = "2"


def main() -> int:
    """Build the site, by default in .site/; return the exit code."""
    folder = Path(sys.argv[1]).resolve() if __name__ == "__main__" and len(sys.argv) > 1 else HTML
    code = build(folder)
    print(f"site: {(folder / 'index.html').as_uri()}" if code == 0 else "site: the build failed")
    return code


def build(html: Path = HTML) -> int:
    """Build the site without a cache, print the warnings, and return Sphinx's exit code.

    A cache would hide warnings about unchanged pages, such as a link to a heading that no longer
    exists on another page.
    """
    from sphinx.cmd.build import build_main  # takes a second, which the link check does not need

    from scripts.playground import BuildError, is_possible, write

    shutil.rmtree(html, ignore_errors=True)
    options = ("--builder=html", "--fail-on-warning", "--keep-going", f"--jobs={PROCESSES}")
    trees = f"--doctree-dir={html.parent / 'doctrees'}"
    with redirect_stdout(StringIO()):
        code = build_main([*options, "--fresh-env", trees, str(ROOT / "docs"), str(html)])
    if code != 0:
        return int(code)
    if not is_possible():
        print("site: without the playground; to add it, run: npm ci --ignore-scripts")
        return 0
    try:
        write(html / "playground")
    except BuildError as fault:
        print(f"site: {fault}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
