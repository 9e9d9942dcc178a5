"""Alarm states of one robot, as in ISA-18.2; pure, with the time passed by callers."""
