"""Values and images of one robot, on their way to all its pages."""
