"""Encoders and decoders of the messages on the dashboard's sockets."""
