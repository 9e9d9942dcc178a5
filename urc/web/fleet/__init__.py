"""The robots that are served."""
