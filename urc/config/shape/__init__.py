"""The shape of a document: its schema, and the differences as problems."""
