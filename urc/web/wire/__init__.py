"""Encoders and decoders for the messages on the dashboard's sockets."""
