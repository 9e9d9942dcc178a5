"""The guard: a small process that owns the lines of a robot that moves, and stops it.

It stands on the transports and on `urc.motion`; sessions stand on it. The guard runs nothing of a
document: no template, no pattern, no parser. It gets rendered frames, and the stop frame before any
motion.

`guard_client` is the engine's side: `GuardClient` talks to a guard over a `Channel`, by the
messages of `messages`. A `PipeChannel` leads to a process with a `GuardServer`, a `LocalChannel`
to a `GuardServer` in this process.
"""
