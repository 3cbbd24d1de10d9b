"""A test of any arm behind the actions that the executor knows: named checks, each with a line."""
