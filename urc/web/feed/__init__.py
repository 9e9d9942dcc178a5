"""One robot's readings and images, to all who watch it, and the lines they go by."""
