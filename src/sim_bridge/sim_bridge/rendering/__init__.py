"""What the camera sees: the scene drawn by ray casting, and the sensor's faults on top."""
