"""Pictures of certificates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from paretoik.errors import InvalidInput
from paretoik.front.certificates import Certificates
from paretoik.review.pictures.certificates import certificates_picture


def certified(front, statuses):
    """Return a front with certificates; the statuses repeat over its points."""
    points, n_obj = front.objectives.shape
    rates = np.full((points, n_obj, n_obj), -0.5)
    rates[::3] = np.nan  # not certified
    rates[:, np.arange(n_obj), np.arange(n_obj)] = 1.0
    rng = np.random.default_rng(0)
    certificates = Certificates(
        violation=np.zeros(points),
        violation_between=rng.uniform(1e-6, 1e-3, points),
        criticality=rng.uniform(1e-12, 1e-8, points),
        weights=rng.dirichlet(np.ones(n_obj), points),
        exchange_rates=rates,
        exchange_intervals=np.stack([rates, rates], axis=-1),
        status=np.resize(np.array(statuses), points),
    )
    return replace(front, certificates=certificates)


@pytest.mark.parametrize("n_obj", [1, 2, 3, 5])
def test_every_certified_front_gets_a_small_picture_with_content(n_obj, tmp_path, make_front):
    front = certified(make_front(n_obj, points=30), ["minimum", "saddle", "undetermined"])
    file = tmp_path / "certificates.png"
    certificates_picture(front, file)
    assert file.stat().st_size < 150_000
    with Image.open(file) as picture:
        pixels = np.asarray(picture.convert("L"))
    assert 0.005 < (pixels < 128).mean() < 0.5


def test_a_front_without_certificates_is_refused(tmp_path, make_front):
    with pytest.raises(InvalidInput, match="front must have certificates"):
        certificates_picture(make_front(2), tmp_path / "certificates.png")
