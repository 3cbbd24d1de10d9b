"""The one error that ends the command with a line for a person."""


class CommandError(Exception):
    """A request that cannot be fulfilled; the text is the whole message."""
