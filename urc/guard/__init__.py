"""The guard: a process that owns a robot's connections and stops the robot if the server fails.

The guard imports the transports and `urc.motion`; sessions import the guard. The guard never reads
a document and runs no templates, patterns or parsers. The guard receives only rendered frames, and
receives the stop frame before any motion frame.

The engine uses `guard_client.GuardClient`, which exchanges the messages in `messages` with the
guard over a `Channel`. A `PipeChannel` connects to a `GuardServer` in a separate process; a
`LocalChannel` connects to a `GuardServer` in this process.
"""
