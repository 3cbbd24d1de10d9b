"""A small `ros2` command: the verbs that this project uses, as the real command has them."""
