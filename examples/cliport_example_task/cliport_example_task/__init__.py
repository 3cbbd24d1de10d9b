"""A task that is added to the benchmark from outside: put-block-on-mat."""
