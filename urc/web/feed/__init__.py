"""Distribution of one robot's values and images to all its pages."""
