"""All framings. Each family of framings is a module that is imported on first use."""
