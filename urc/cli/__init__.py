"""The verbs of the `urc` command."""
