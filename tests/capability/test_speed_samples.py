"""Errors of fits, and samples that cannot be used."""

import re

import numpy as np
import pytest

from paretoik.capability.speed_fit import fit_axes, fit_ellipsoids, fit_errors
from paretoik.errors import InvalidInput
from tests.capability.fields import field, grid, units, within


def test_errors_are_shares_of_the_true_speed_and_say_where():
    model, directions = field(2), units(4)
    positions = within(model, 3)
    factor = np.ones((3, 4))
    factor[1, 2], factor[2, 0] = 1 / 1.25, 2.0
    errors = fit_errors(model, positions, directions, factor * model.speeds(positions, directions))
    assert errors.overestimate == pytest.approx(0.25)
    assert errors.underestimate == pytest.approx(0.5)
    assert errors.rms == pytest.approx(np.sqrt((0.25**2 + 0.5**2) / 12))
    assert np.all(errors.position == positions[1])
    assert np.all(errors.direction == directions[2])


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p, d, v: (p, d, v[:, :3]), "speeds: shape (9, 8) wanted, got (9, 3)"),
        (lambda p, d, v: (p, d, v.T), "speeds: shape (9, 8) wanted, got (8, 9)"),
        (lambda p, d, v: (p[:, 0], d, v), "positions: a table of rows and columns wanted, got shape (9,)"),
        (lambda p, d, v: (p[:, :1], d[:, :1], v), "positions: two or three coordinates wanted, got 1"),
        (lambda p, d, v: (p, np.pad(d, ((0, 0), (0, 1))), v), "directions: 2 coordinates wanted, as positions have"),
        (lambda p, d, v: (p, 2 * d, v), "directions: unit vectors wanted, got length 2 at direction 0"),
        (lambda p, d, v: ("here", d, v), "positions: must hold real numbers, got text"),
        (lambda p, d, v: (p * np.nan, d, v), "positions: finite numbers wanted, got nan in row 0, column 0"),
        (lambda p, d, v: (p, d[[0, 0, 4]], v[:, :3]), "got 3 that determine 2 of its 3 numbers"),
        (lambda p, d, v: (p, d[[0, 3]], v[:, :2]), "directions: at least 3 wanted that determine an ellipsoid"),
        (lambda p, d, v: (p[:5], d, v[:5]), "positions: at least 6 wanted for polynomials of degree 2 in 2"),
        (lambda p, d, v: (p * [1, 0], d, v), "in general position, got 9 that determine only 3 of 6 terms"),
        (lambda p, d, v: (p[[0] * 9], d, v), "in general position, got 9 that determine only 1 of 6 terms"),
    ],
)
@pytest.mark.parametrize("fit", [fit_ellipsoids, fit_axes])
def test_what_cannot_be_fitted_is_refused_by_name(change, message, fit):
    with pytest.raises(InvalidInput, match=re.escape(message)) as caught:
        fit(*change(grid(3), units(8), np.ones((9, 8))))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 0.0, -1.0])
def test_a_wrong_speed_is_named_with_its_position_and_direction(wrong):
    speeds = np.ones((9, 8))
    speeds[4, 6] = wrong
    for use in (fit_ellipsoids, fit_axes, lambda *samples: fit_errors(field(2), *samples)):
        with pytest.raises(InvalidInput, match=f"positive numbers wanted, got {wrong} at position 4, direction 6"):
            use(grid(3), units(8), speeds)


def test_spatial_positions_have_no_axes_and_no_planar_errors():
    positions, ways = np.random.default_rng(0).normal(size=(12, 3)), units(8, task=3)
    with pytest.raises(InvalidInput, match="positions: two coordinates wanted for ellipses, got 3"):
        fit_axes(positions, ways, np.ones((12, 8)))
    with pytest.raises(InvalidInput, match="positions: 2 coordinates wanted, got 3"):
        fit_errors(field(2), positions, ways, np.ones((12, 8)))
