"""All framings, with one module per family that is imported on first use."""
