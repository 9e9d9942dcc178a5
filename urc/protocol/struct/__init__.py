"""The form ``struct``: binary frames with fixed and variable fields."""
