"""Arms that specs can name: figures from published robot support packages, as data."""

from .arms import models, reach_mm

__all__ = ["models", "reach_mm"]
