"""The shape of a document: what its schema asks for, and the findings where it differs."""
