"""Generates and compiles Python source code for a driver."""
