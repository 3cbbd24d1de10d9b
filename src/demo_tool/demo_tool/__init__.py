"""Demonstration page: a person draws a box and clicks a rotation, and the arm does it."""
