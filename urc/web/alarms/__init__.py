"""The HTTP API for alarms."""
