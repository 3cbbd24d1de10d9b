"""The benchmark: data generation and evaluation in the simulator."""
