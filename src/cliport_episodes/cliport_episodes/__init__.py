"""Demonstrations as rosbag2 folders: writing, reading, editing."""
