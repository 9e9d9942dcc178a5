"""The shape of a document: its schema, and the problems where it differs."""
