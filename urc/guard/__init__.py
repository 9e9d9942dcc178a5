"""The guard: a small process that owns the lines of a moving robot, and stops the robot.

The guard uses the transports and `urc.motion`; sessions use the guard. The guard runs nothing of a
document: no template, no pattern, no parser. The guard gets rendered frames, and the stop frame
    before any motion.

`guard_client` is the engine's side: `GuardClient` talks to a guard over a `Channel`, by the
messages of `messages`. A `PipeChannel` leads to a process with a `GuardServer`, a `LocalChannel`
to a `GuardServer` in this process.
"""
