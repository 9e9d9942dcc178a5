// The types of Pyodide, where its modules are in the built playground.
export * from "pyodide";
