"""The HTTP API for alarms, and the notifications about new alarms."""
