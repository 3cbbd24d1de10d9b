"""The policy server's parts without its node: the states it goes through, its executor, its inference thread."""
