"""Policy networks, from tensors to tensors, batched: what all share; `compact`, `joint` and `streams` are the kinds."""
