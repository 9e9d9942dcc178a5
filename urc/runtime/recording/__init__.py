"""Recordings: what happens with a robot, kept in a file, and played back."""
