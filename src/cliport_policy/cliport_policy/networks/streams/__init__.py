"""Networks of streams: CLIPort, the paper's baselines and its ablations, composed by a config."""
