"""ROS through rosbridge or the Foxglove bridge."""
