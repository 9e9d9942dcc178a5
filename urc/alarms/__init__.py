"""Alarm states of one robot, as in ISA-18.2. Callers pass the current time, in UTC seconds."""
