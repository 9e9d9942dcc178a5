"""Recordings: files with the events of a robot, and their playback."""
