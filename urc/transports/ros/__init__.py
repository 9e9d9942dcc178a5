"""ROS through rosbridge."""
