"""Tensors in, tensors out: the networks of the compact policy, batched, free of data sets and of ROS."""
