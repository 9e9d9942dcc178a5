"""Recordings: the events of a robot in a file, and their playback."""
