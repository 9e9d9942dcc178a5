"""Sign-in over HTTP: the ways in, and what people manage about themselves."""
