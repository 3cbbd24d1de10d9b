"""The training loop and what surrounds it: options, losses, state, processes, log."""
