"""Demonstrations as training reads them: on disk, mixed, reworded, augmented, in batches."""
