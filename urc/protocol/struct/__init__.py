"""The binary form: fixed and variable fields in a frame."""
