"""Errors of cliport_benchmark: one root, values carried, the remedy named."""

from __future__ import annotations


class BenchmarkError(Exception):
    """Root of everything that this package raises on purpose."""


class OptionError(BenchmarkError):
    """A command line option whose value cannot be used."""


class SceneError(BenchmarkError):
    """A scene that the running simulator refused to make."""


class DataFolderError(BenchmarkError):
    """A data folder that cannot be written, read or continued."""
