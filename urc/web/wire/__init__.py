"""What goes over a dashboard's sockets: message shapes, and nothing else."""
