"""The guard: a small process that owns the lines of a robot that moves, and stops it.

Floor 4. It runs nothing that comes from a document: no template, no pattern, no parser. What it
writes was rendered elsewhere, and the stop before anything moved. `host` is what happens in there,
`client` and `proxy` are the server's side of it; `wire` and `pipe` are between them.
"""
