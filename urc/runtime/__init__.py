"""A robot being driven: links, latest values, sessions."""
