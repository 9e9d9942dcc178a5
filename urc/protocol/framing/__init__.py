"""All framings; each framing family is a module that is imported on first use."""
