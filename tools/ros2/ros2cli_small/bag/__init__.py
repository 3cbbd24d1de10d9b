"""ros2 bag: record topics into rosbag2's folders, play them back, say what is in them. `rosbags` knows the files."""
