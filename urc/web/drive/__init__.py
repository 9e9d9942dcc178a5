"""Who holds the controls of a robot, and how their hands reach it."""
