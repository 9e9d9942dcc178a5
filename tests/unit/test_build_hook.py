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
    monkeypatch.setattr(hatch_build, "FOLDERS", {})


def test_collect_copies_the_list_and_maps_the_name(tmp_path: Path) -> None:
    """Only what is listed is kept, and the import map is relative to the folder."""
    modules = install(tmp_path, "./dist/chart.js", ("dist/chart.js", "LICENSE", "dist/other.js"))
    vendor = hatch_build.collect(modules, tmp_path / "vendor", tmp_path)
    kept = sorted(str(path.relative_to(vendor)) for path in vendor.rglob("*") if path.is_file())
    assert kept == ["__init__.py", "chart/LICENSE", "chart/dist/chart.js", "importmap.json"]
    shown = json.loads((vendor / "importmap.json").read_text("utf-8"))
    assert shown == {"imports": {"chart": "./chart/dist/chart.js"}}


def test_a_file_that_is_gone_stops_the_build(tmp_path: Path) -> None:
    """An upgrade that drops the licence or renames a file is noticed at once."""
    modules = install(tmp_path, "dist/chart.js", ("dist/chart.js",))
    with pytest.raises(hatch_build.VendorError) as caught:
        hatch_build.collect(modules, tmp_path / "vendor", tmp_path)
    assert str(caught.value) == "npm package 'chart' no longer has the file 'LICENSE'"


def test_an_entry_that_moved_stops_the_build(tmp_path: Path) -> None:
    """The import map can't point at a file that is not shipped."""
    modules = install(tmp_path, "dist/new.js", ("dist/chart.js", "LICENSE"))
    with pytest.raises(hatch_build.VendorError) as caught:
        hatch_build.collect(modules, tmp_path / "vendor", tmp_path)
    assert str(caught.value) == (
        "npm package 'chart' has a new entry point 'dist/new.js', which is not in VENDORED"
    )


def test_a_package_without_its_licence_gets_it_from_this_repository(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some packages are published without the text of their licence."""
    monkeypatch.setattr(hatch_build, "VENDORED", {"chart": ("dist/chart.js",)})
    monkeypatch.setattr(hatch_build, "LICENCES", {"chart": "LICENSES/MIT.txt"})
    (tmp_path / "LICENSES").mkdir()
    (tmp_path / "LICENSES" / "MIT.txt").write_text("as is", encoding="utf-8")
    modules = install(tmp_path, "dist/chart.js", ("dist/chart.js",))
    vendor = hatch_build.collect(modules, tmp_path / "vendor", tmp_path)
    assert (vendor / "chart" / "LICENSE").read_text("utf-8") == "as is"


@pytest.mark.parametrize(
    "line",
    ["import { a } from './a.js';", "export * from 'other';", "import {\n a,\n} from './a.js';"],
)
def test_an_import_of_what_is_not_kept_stops_the_build(tmp_path: Path, line: str) -> None:
    """A page must not find out that a package has grown another file."""
    modules = install(tmp_path, "dist/chart.js", ("dist/chart.js", "LICENSE"))
    (modules / "chart" / "dist" / "chart.js").write_text(line, encoding="utf-8")
    with pytest.raises(hatch_build.VendorError) as caught:
        hatch_build.collect(modules, tmp_path / "vendor", tmp_path)
    assert "chart/dist/chart.js imports" in str(caught.value)


def test_a_style_sheet_has_a_name_in_the_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page finds the look of a module by the module's name."""
    monkeypatch.setattr(hatch_build, "VENDORED", {"chart": ("dist/chart.js", "a/chart.css")})
    modules = install(tmp_path, "dist/chart.js", ("dist/chart.js", "a/chart.css"))
    vendor = hatch_build.collect(modules, tmp_path / "vendor", tmp_path)
    shown = json.loads((vendor / "importmap.json").read_text("utf-8"))
    assert shown["imports"]["chart/style.css"] == "./chart/a/chart.css"
