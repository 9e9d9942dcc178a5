"""Documents in a folder of a test's own, and what checking one of them gives."""

from pathlib import Path

from urc.config.load import CheckResult, check
from urc.config.parse.widget import WidgetFolder
from urc.problems import Problem
from urc.runtime.registries import built_in_catalog

ROOT = Path(__file__).resolve().parents[3]
SHELF = ROOT / "tests" / "broken" / "shelf"
FRAMING = "framing: { type: delimiter, tx: LF, rx: LF }"
WIRE = f"transports:\n  wire: {{ type: tcp, host: robot, port: 6789, {FRAMING} }}\n"


class Folder:
    """Writes documents into one folder and checks one of them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def write(self, **texts: str) -> None:
        for name, text in texts.items():
            file = self.folder / (name.replace("__", "/") + ".yaml")
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, "utf-8")

    def check(self, name: str) -> CheckResult:
        return check(self.folder / f"{name}.yaml", built_in_catalog(), WidgetFolder(SHELF))

    def found(self, name: str) -> list[Problem]:
        return list(self.check(name).problems)


def head(kind: str, name: str) -> str:
    return f"urc: 1\nkind: {kind}\nname: {name}\n"
