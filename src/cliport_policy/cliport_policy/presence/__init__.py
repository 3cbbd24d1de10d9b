"""Presence: whether what a sentence names is to be seen at all, told by kinds of things and by colours."""
