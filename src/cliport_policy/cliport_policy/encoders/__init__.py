"""Frozen encoders of images and sentences: read from files or packages, never trained, never in checkpoints."""
