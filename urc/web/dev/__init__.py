"""The developer page of a robot: traffic log, parser try-out and command preview."""
