"""The build hook: which file an import means, and that nothing is missing in silence."""

import json
from pathlib import Path
from typing import Any

import pytest

import hatch_build


@pytest.mark.parametrize(
    ("package", "entry"),
    [
        ({"main": "./dist/a.cjs.js", "module": "./dist/a.esm.js"}, "dist/a.esm.js"),
        ({"main": "a.js"}, "a.js"),
        ({}, "index.js"),
        ({"exports": "./a.mjs", "module": "b.js"}, "a.mjs"),
        ({"exports": {".": "./a.mjs"}}, "a.mjs"),
        ({"exports": {"import": "./a.mjs", "require": "./a.cjs"}}, "a.mjs"),
        (
            {"exports": {".": {"require": "./a.cjs", "import": {"default": "./a.mjs"}}}},
            "a.mjs",
        ),
        ({"exports": {".": {"browser": "./b.js", "import": "./a.mjs"}}}, "b.js"),
        ({"exports": {"./sub": "./s.js"}, "main": "m.js"}, "m.js"),
    ],
)
def test_entry_point_is_what_a_browser_imports(package: dict[str, Any], entry: str) -> None:
    """`exports` wins over `module`, `module` over `main`."""
    assert hatch_build.entry_point(package) == entry


def install(folder: Path, module: str, files: tuple[str, ...]) -> Path:
    """Play npm: put a package `chart` with these files into node_modules."""
    for name in files:
        path = folder / "node_modules" / "chart" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"the {name}", encoding="utf-8")
    manifest = folder / "node_modules" / "chart" / "package.json"
    manifest.write_text(json.dumps({"module": module}), encoding="utf-8")
    return folder / "node_modules"


@pytest.fixture(autouse=True)
def _one_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hatch_build, "VENDORED", {"chart": ("dist/chart.js", "LICENSE")})


def test_collect_copies_the_list_and_maps_the_name(tmp_path: Path) -> None:
    """Only what is listed is kept, and the import map is relative to the folder."""
    modules = install(tmp_path, "./dist/chart.js", ("dist/chart.js", "LICENSE", "dist/other.js"))
    vendor = hatch_build.collect(modules, tmp_path / "vendor")
    kept = sorted(str(path.relative_to(vendor)) for path in vendor.rglob("*") if path.is_file())
    assert kept == ["__init__.py", "chart/LICENSE", "chart/dist/chart.js", "importmap.json"]
    shown = json.loads((vendor / "importmap.json").read_text("utf-8"))
    assert shown == {"imports": {"chart": "./chart/dist/chart.js"}}


def test_a_file_that_is_gone_stops_the_build(tmp_path: Path) -> None:
    """An upgrade that drops the licence or renames a file is noticed at once."""
    modules = install(tmp_path, "dist/chart.js", ("dist/chart.js",))
    with pytest.raises(hatch_build.VendorError) as caught:
        hatch_build.collect(modules, tmp_path / "vendor")
    assert str(caught.value) == "npm package 'chart' has no file 'LICENSE' any more"


def test_an_entry_that_moved_stops_the_build(tmp_path: Path) -> None:
    """The import map can't point at a file that is not shipped."""
    modules = install(tmp_path, "dist/new.js", ("dist/chart.js", "LICENSE"))
    with pytest.raises(hatch_build.VendorError) as caught:
        hatch_build.collect(modules, tmp_path / "vendor")
    assert str(caught.value) == (
        "npm package 'chart' now starts at 'dist/new.js', which is not kept"
    )
