"""Parts of a document → values of the model; names are still text."""
