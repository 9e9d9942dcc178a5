"""One module a transport: the only place where sockets live."""
