"""Immutable classes for the content of documents, after URC has parsed and checked it."""
