"""One door a kind of transport: how a client comes to the emulated robot."""
