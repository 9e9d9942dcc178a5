"""Alarm states of one robot, as in ISA-18.2. The code reads no clock; callers pass the time."""
