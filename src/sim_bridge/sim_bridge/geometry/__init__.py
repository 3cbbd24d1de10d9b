"""Meshes, outlines, and points on their surfaces."""
