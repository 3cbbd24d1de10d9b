"""Errors of the policy: one root, and each message is one line that names the value and the remedy."""


class PolicyError(Exception):
    """Root of every error that this package raises on purpose."""


class InstructionError(PolicyError):
    """An instruction that the policy refuses: empty, too long, or unlike anything it was trained on."""


class CheckpointError(PolicyError):
    """A checkpoint that is missing, damaged or made for another version."""


class ConfigError(PolicyError):
    """A setting of the network or of the training that cannot work."""


class EncoderError(PolicyError):
    """A frozen encoder whose file is missing, damaged or of another kind."""


class DataError(PolicyError):
    """A demonstration set that is missing, damaged or does not fit the configuration."""


class TrainingError(PolicyError):
    """A training that has gone wrong and must not be saved over what was good."""


class ObservationError(PolicyError):
    """An observation whose workspace is not the one the policy was trained on, or that shows nothing."""
