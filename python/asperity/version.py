"""The version, as `pyproject.toml` reads it."""

__version__ = "2.0.0"
