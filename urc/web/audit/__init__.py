"""The audit log on pages and in the API: search, export and the timeline of a robot."""
