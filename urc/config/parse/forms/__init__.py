"""Forms of frames, one module each; `urc.config.parse.form` has the table."""
