"""The guard: a small process that owns a robot's connections and stops it if the server fails.

The guard imports the transports and `urc.motion`; sessions import the guard. The guard evaluates no
part of a document: no template, no pattern, no parser. The guard receives rendered frames only, and
receives the stop frame before any motion.

`GuardClient` in `guard_client` is the engine's side and exchanges the `messages` with the guard
over a `Channel`. A `PipeChannel` connects to a `GuardServer` in a separate process; a
`LocalChannel` connects to one in this process.
"""
