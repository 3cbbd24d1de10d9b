"""The simulator: PyBullet world, camera, arm controllers, and the benchmark's tasks."""
