"""The types of the messages between a server and its clients, without encoders."""
