"""Errors of the policy: one root, and each message is one line that names the value and the remedy."""


class PolicyError(Exception):
    """Root of every error that this package raises on purpose."""


class InstructionError(PolicyError):
    """Refusal of an instruction: empty, too long, or unlike anything the policy was trained on."""


class CheckpointError(PolicyError):
    """Checkpoint that is missing, damaged or made for another version."""


class ConfigError(PolicyError):
    """Setting of the network or of the training that cannot work."""


class EncoderError(PolicyError):
    """Frozen encoder whose file is missing, damaged or of another kind."""


class DataError(PolicyError):
    """Demonstration set that is missing, damaged or does not fit the configuration."""


class TrainingError(PolicyError):
    """Training that has gone wrong and must not be saved over what was good."""


class ObservationError(PolicyError):
    """Observation that shows nothing, or whose workspace is not the one the policy was trained on."""
