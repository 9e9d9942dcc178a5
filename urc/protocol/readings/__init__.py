"""Conversion of decoded fields to signals, with alarms and change filters."""
