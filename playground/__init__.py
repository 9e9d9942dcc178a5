"""The playground: the validator, and a robot with its dashboard, in a page without a server.

Python runs in a web worker (Pyodide). This package is part of the site, not of the wheel: only
`playground.build` runs outside of a browser. See docs/playground.md.
"""
