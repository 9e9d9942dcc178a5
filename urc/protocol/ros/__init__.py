"""ROS messages in their binary forms: definitions, generated readers and writers. Pure."""
