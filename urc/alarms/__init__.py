"""Alarm states of one robot, as in ISA-18.2. The code is pure; callers pass the time."""
