"""Tolerances of preferences and of the words that explain them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class PreferenceOptions:
    """Settings of choosing; shares are of the ranges.

    Scores within ``rounding`` are equal: units and offsets move them by less. ``augmentation`` is the weight of the sum
    of all shares beside the worst one (Miettinen 1999, section 3.4.5). A point that lies less than ``hull`` above
    straight lines between others can be reached by weights. Exchange rates hold as far as they predict within a share
    ``prediction``. Up to so many ``described`` objectives every comparison has a sentence.
    Mixtures that might beat a point begin with its ``neighbours`` nearest points.
    """

    rounding: float = 1e-9
    augmentation: float = 1e-4
    hull: float = 1e-6
    prediction: float = 0.1
    described: int = 3
    neighbours: int = 30


OPTIONS = PreferenceOptions()
