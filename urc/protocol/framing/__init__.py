"""All framings. Framing families, each a module that is imported on first use."""
