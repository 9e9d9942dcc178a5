"""Composition of documents: `extends`, `include`, `params` and `each`."""
