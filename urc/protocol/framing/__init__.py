"""All framings, one module per family; each is imported on first use."""
