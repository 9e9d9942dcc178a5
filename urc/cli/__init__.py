"""The subcommands of the `urc` program, one module each."""
