// Compile the Python files of a folder with the Python of Pyodide, for a faster start in browsers:
//
//     node playground/compile.mjs FOLDER_OF_PYODIDE FOLDER_TO_COMPILE
//
// Each file.py becomes file.pyc in the same place. Browsers then compile nothing.
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [pyodide, folder] = process.argv.slice(2).map((one) => resolve(one));
const { loadPyodide } = await import(pathToFileURL(`${pyodide}/pyodide.mjs`).href);
const python = await loadPyodide({ indexURL: pyodide });
python.FS.mkdirTree("/tree");
python.FS.mount(python.FS.filesystems.NODEFS, { root: folder }, "/tree");
const faults = python.runPython(`
import os, py_compile
from pathlib import Path

faults = []
for file in sorted(Path("/tree").rglob("*.py")):
    shown = file.relative_to("/tree").as_posix()
    try:
        py_compile.compile(
            str(file), str(file.with_suffix(".pyc")), shown.partition("/")[2], doraise=True,
            invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH,
        )
    except py_compile.PyCompileError as fault:
        if "/tests/" not in shown and "lib2to3" not in shown:
            faults.append(str(fault))
    else:
        file.unlink()
"\\n".join(faults)
`);
if (faults) console.error(faults);
process.exit(faults ? 1 : 0);
