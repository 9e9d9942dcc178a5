"""The HTTP API of alarms."""
