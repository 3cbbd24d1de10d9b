"""The one error that ends the command with a line for a person."""


class CommandError(Exception):
    """What was asked for cannot be done; the text is the whole message."""
