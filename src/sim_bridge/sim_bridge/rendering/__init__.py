"""Images of the simulated camera: the scene drawn by ray casting, and the sensor's faults on top."""
