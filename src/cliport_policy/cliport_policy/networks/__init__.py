"""Policy networks, from tensors to tensors, batched: what all share; `compact` and `streams` hold the two kinds."""
