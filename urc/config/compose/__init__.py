"""Composes documents: `extends`, `include`, `params` and `each`."""
