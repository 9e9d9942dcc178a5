"""ROS messages in binary form: definitions, and generated readers and writers. Pure."""
