"""What the check of one misprint returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Erratum:
    """One misprint and its check.

    Parameters
    ----------
    key, where : str
        Letter, and equation or section of the paper.
    printed, right : str
        What stands there, and what should.
    numbers : mapping of str to float
        What the check computed; units in the names, SI where none is named.
    sentence : str
        What follows.
    """

    key: str
    where: str
    printed: str
    right: str
    numbers: Mapping[str, float]
    sentence: str
