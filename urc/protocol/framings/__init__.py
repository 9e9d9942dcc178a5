"""The framings beside the delimiter, one module a family; each is imported when it is used."""
