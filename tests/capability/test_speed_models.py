"""Speed models: what was put in comes back, units and axes do not matter, and safe fits are below every sample."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from paretoik.capability.speed_fits import LogErrors, fit_axes, fit_ellipsoids, fit_errors, starts
from paretoik.capability.speed_models import (
    AxesEllipses,
    LogEllipsoids,
    Polynomials,
    exponential,
    factors,
    planar_exponential,
)
from paretoik.errors import InvalidInput, SolverFailed

TASKS = [2, 3]


def units(size, *, task=2, seed=0):
    """Unit vectors: of half the circle, evenly, or of the sphere."""
    if task == 2:
        angles = np.pi * np.arange(size) / size
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)
    drawn = np.random.default_rng(seed).normal(size=(size, 3))
    return drawn / np.linalg.norm(drawn, axis=1, keepdims=True)


def field(task, *, degree=2, seed=0):
    """A model of random ellipsoids about the middle of a box of 0.2 m, their speeds about 2 m/s."""
    rng = np.random.default_rng(seed)
    terms = len(factors(task, degree))
    entries = 0.4 * rng.normal(size=(terms, task, task))
    entries = entries + np.swapaxes(entries, 1, 2)
    entries[0] += 2 * np.log(2.0) * np.eye(task)
    center = np.array([0.4, -0.3, 0.2])[:task]
    logs = Polynomials(degree=degree, center=center, scale=0.1, coefficients=entries.reshape(terms, -1))
    return LogEllipsoids(logs=logs, lower=center - 0.1, upper=center + 0.1)


def within(model, size, *, seed=1):
    return np.random.default_rng(seed).uniform(model.lower, model.upper, size=(size, len(model.lower)))


def arm_maxima(positions, directions):
    """Directional maxima of a planar arm of three joints: outlines of zonotopes, the best of 240 postures."""
    lengths, rates = np.array([0.114, 0.114, 0.129]), np.array([3.3, 13.2, 13.2])
    first = np.linspace(-np.pi, np.pi, 120, endpoint=False)
    wrist = positions[:, None] - lengths[0] * np.stack([np.cos(first), np.sin(first)], axis=1)
    cosine = (np.sum(wrist**2, axis=-1) - lengths[1] ** 2 - lengths[2] ** 2) / (2 * lengths[1] * lengths[2])
    elbow = np.arccos(np.clip(cosine, -1, 1)) * np.array([1, -1])[:, None, None]
    second = np.arctan2(wrist[..., 1], wrist[..., 0])
    second = second - np.arctan2(lengths[2] * np.sin(elbow), lengths[1] + lengths[2] * np.cos(elbow))
    angles = np.stack([np.broadcast_to(first, second.shape), second, second + elbow], axis=-1)
    links = lengths[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    normals = np.cumsum(links[..., ::-1, :], axis=-2)[..., ::-1, :]  # from each joint to the tool: at right angles to
    turned = np.stack([-normals[..., 1], normals[..., 0]], axis=-1)  # the velocity that it gives
    reach = np.abs(np.einsum("...id,...jd->...ij", normals, turned)) @ rates
    speeds = np.min(reach[..., None] / np.maximum(np.abs(normals @ directions.T), 1e-9), axis=-2)
    return np.max(np.where((np.abs(cosine) < 0.9999)[..., None], speeds, 0.0), axis=(0, 2))


def grid(side):
    x, y = np.meshgrid(np.linspace(0.1, 0.2, side), np.linspace(-0.2, -0.1, side), indexing="ij")
    return np.stack([x.ravel(), y.ravel()], axis=1)


@pytest.fixture(scope="module")
def arm():
    """Positions, directions and directional maxima that no ellipse is near to: the paper's nine positions and more."""
    return grid(4), units(16), arm_maxima(grid(4), units(16))


def log_errors(model, positions, directions, speeds):
    return np.log(model.speeds(positions, directions) / speeds)


def nudged(model, rng):
    moved = 1e-3 * rng.normal(size=model.logs.coefficients.shape)
    moved[:, 2] = moved[:, 1]
    return replace(model, logs=replace(model.logs, coefficients=model.logs.coefficients + moved))


def differences(function, positions, *, nearby=1e-6):
    sides = nearby * np.eye(positions.shape[-1])
    return np.stack([(function(positions + e) - function(positions - e)) / (2 * nearby) for e in sides], axis=-1)


# --- what models are ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("task", TASKS)
def test_the_root_is_that_of_the_exponential_of_the_polynomials(task):
    model = field(task)
    (position,) = within(model, 1)
    x = (position - model.logs.center) / model.logs.scale
    monomials = [1.0, *x, *(x[i] * x[j] for i in range(task) for j in range(i, task))]
    log = np.tensordot(monomials, model.logs.coefficients, 1).reshape(task, task)
    assert model.roots(position)[0] == pytest.approx(expm(-log / 2), rel=1e-12)


@pytest.mark.parametrize("task", TASKS)
def test_along_every_direction_the_speed_is_on_the_ellipsoid_and_the_same_backwards(task):
    model, ways = field(task), units(20, task=task)
    positions = within(model, 5)
    speeds, (roots, _) = model.speeds(positions, ways), model.roots(positions)
    tips = speeds[..., None] * ways
    assert np.linalg.norm(tips @ roots, axis=-1) == pytest.approx(1.0)
    assert model.speeds(positions, -ways) == pytest.approx(speeds, rel=1e-14)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("degree", [0, 1, 3])
def test_derivatives_are_those_of_differences(task, degree):
    model = field(task, degree=degree)
    positions = within(model, 30)
    assert model.roots(positions)[1] == pytest.approx(differences(lambda p: model.roots(p)[0], positions), abs=1e-6)


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("away", [0.0, 1e-14, 1e-9, 1e-5])
def test_derivatives_are_exact_where_radii_are_equal_or_nearly_so(task, away):
    model = field(task, degree=1, seed=3)
    entries = model.logs.coefficients.copy()
    entries[0] = np.eye(task).ravel()  # a ball at the center
    model = replace(model, logs=replace(model.logs, coefficients=entries))
    position = model.logs.center + away * np.array([0.6, -0.8, 0.1])[:task]
    first_order = -0.5 * np.exp(-0.5) * entries[1:].reshape(task, task, task) / model.logs.scale
    found = model.roots(position)[1]
    assert found == pytest.approx(np.moveaxis(first_order, 0, -1), abs=1e-12 + 1e3 * away)
    assert found == pytest.approx(differences(lambda p: model.roots(p)[0], position), abs=1e-6)


def test_in_the_plane_the_closed_form_is_what_eigenvalues_give():
    rng = np.random.default_rng(0)
    exponents = rng.normal(size=(50, 2, 2)) * 10.0 ** rng.uniform(-12, 0.5, size=(50, 1, 1))
    exponents, slopes = exponents + np.swapaxes(exponents, 1, 2), rng.normal(size=(50, 2, 2, 3))
    slopes = slopes + np.swapaxes(slopes, 1, 2)
    for closed, general in zip(planar_exponential(exponents, slopes), exponential(exponents, slopes), strict=True):
        assert closed == pytest.approx(general, rel=1e-9, abs=1e-12 * np.abs(general).max())


@pytest.mark.parametrize("task", TASKS)
def test_a_position_is_worth_the_same_alone_and_in_any_batch(task):
    model = field(task)
    positions = within(model, 6)
    roots, slopes = model.roots(positions.reshape(2, 3, task))
    for index, position in enumerate(positions):
        alone, its_slopes = model.roots(position)
        assert roots[index // 3, index % 3] == pytest.approx(alone, rel=1e-13, abs=1e-14)
        assert slopes[index // 3, index % 3] == pytest.approx(its_slopes, rel=1e-12, abs=1e-12)


def test_scaled_models_are_so_much_faster():
    model = field(3)
    positions, ways = within(model, 4), units(7, task=3)
    assert model.scaled(1.3).speeds(positions, ways) == pytest.approx(1.3 * model.speeds(positions, ways))


# --- what fits are -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_a_field_of_ellipsoids_comes_back(task, degree):
    truth = field(task, degree=degree, seed=degree)
    positions, ways = within(truth, len(factors(task, degree)) + 5), units(9, task=task)
    fitted = fit_ellipsoids(positions, ways, truth.speeds(positions, ways), degree=degree)
    elsewhere, across = within(truth, 40, seed=9), units(33, task=task, seed=9)
    assert log_errors(fitted, elsewhere, across, truth.speeds(elsewhere, across)) == pytest.approx(0.0, abs=1e-9)
    assert np.all(fitted.lower == positions.min(axis=0))
    assert np.all(fitted.upper == positions.max(axis=0))


@pytest.mark.parametrize("task", TASKS)
def test_errors_of_fits_have_the_derivatives_of_differences(task):
    truth, rng = field(task), np.random.default_rng(2)
    positions, ways = within(truth, 8), units(7, task=task)
    errors = LogErrors(basis=rng.normal(size=(8, 3)), directions=ways, logs=np.log(truth.speeds(positions, ways)))
    numbers = rng.normal(size=(3, len(errors.parts)))
    weights = rng.normal(size=errors.logs.size)
    slopes = differences(lambda x: errors(x.reshape(numbers.shape))[0], numbers.ravel())
    bends = differences(lambda x: weights @ errors(x.reshape(numbers.shape))[1], numbers.ravel())
    assert errors(numbers)[1] == pytest.approx(slopes, abs=1e-7)
    assert errors.curvature(numbers, weights) == pytest.approx(bends, abs=1e-6)


def test_starts_are_exact_for_ellipsoids_and_short_for_anything():
    truth, ways = field(3, degree=0), units(12, task=3)
    positions = within(truth, 4)
    logs = np.log(truth.speeds(positions, ways))
    errors = LogErrors(basis=np.eye(4), directions=ways, logs=logs)
    assert errors(starts(ways, logs))[0] == pytest.approx(0.0, abs=1e-9)
    wild = np.random.default_rng(0).normal(size=(5, 12))
    radii = np.exp(np.linalg.eigvalsh(np.tensordot(starts(ways, wild), errors.parts, 1)) / 2)
    assert np.all(radii <= 3.0001 * np.exp(wild.max(axis=1, keepdims=True)))
    assert np.all(radii >= np.exp(wild.min(axis=1, keepdims=True)) / 3.0001)


def test_no_model_nearby_has_smaller_errors(arm):
    fitted = fit_ellipsoids(*arm)
    least, rng = np.sum(log_errors(fitted, *arm) ** 2), np.random.default_rng(0)
    for _ in range(20):
        assert np.sum(log_errors(nudged(fitted, rng), *arm) ** 2) > least


@pytest.mark.parametrize("safe", [False, True])
def test_units_of_length_do_not_matter(arm, safe):
    positions, ways, speeds = arm
    meters = fit_ellipsoids(positions, ways, speeds, safe=safe)
    millimeters = fit_ellipsoids(1e3 * positions, ways, 1e3 * speeds, safe=safe)
    inside = within(meters, 20)
    assert millimeters.speeds(1e3 * inside, ways) == pytest.approx(1e3 * meters.speeds(inside, ways), rel=1e-6)


@pytest.mark.parametrize("safe", [False, True])
def test_turning_everything_turns_the_model(arm, safe):
    positions, ways, speeds = arm
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    model = fit_ellipsoids(positions, ways, speeds, safe=safe)
    turned = fit_ellipsoids(positions @ turn.T + 2.0, ways @ turn.T, speeds, safe=safe)
    inside = within(model, 20)
    assert turned.speeds(inside @ turn.T + 2.0, ways @ turn.T) == pytest.approx(model.speeds(inside, ways), rel=1e-4)


# --- safe fits ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("margin", [0.0, 0.05])
@pytest.mark.parametrize("degree", [1, 2])
def test_safe_fits_are_below_every_sample_and_nearer_than_a_shrunk_fit(arm, degree, margin):
    free = fit_ellipsoids(*arm, degree=degree)
    safe = fit_ellipsoids(*arm, degree=degree, safe=True, margin=margin)
    shrunk = free.scaled(np.exp(-margin) / (1 + fit_errors(free, *arm).overestimate))
    errors, plain = log_errors(safe, *arm), log_errors(shrunk, *arm)
    assert np.all(errors <= -margin)
    assert errors.max() == pytest.approx(-margin, abs=1e-9)
    assert np.sum(errors**2) < 0.8 * np.sum(plain**2)
    assert -errors.mean() < -plain.mean()


@pytest.mark.parametrize("seed", range(4))
def test_safe_fits_are_stationary(seed):
    rng, truth = np.random.default_rng(seed), field(2, degree=1, seed=seed)
    positions, ways = within(truth, 8), units(12)
    speeds = truth.speeds(positions, ways) * np.exp(rng.uniform(-0.2, 0.2, size=(8, 12)))
    safe = fit_ellipsoids(positions, ways, speeds, degree=1, safe=True)
    least = np.sum(log_errors(safe, positions, ways, speeds) ** 2)
    for _ in range(50):
        other = nudged(safe, rng)
        other = other.scaled(np.exp(-log_errors(other, positions, ways, speeds).max()))
        assert np.sum(log_errors(other, positions, ways, speeds) ** 2) > least


def test_a_safe_fit_of_ellipsoids_is_exact():
    truth, ways = field(3), units(12, task=3)
    positions = within(truth, 20)
    speeds = truth.speeds(positions, ways)
    safe = fit_ellipsoids(positions, ways, speeds, safe=True, margin=0.02)
    assert log_errors(safe, positions, ways, speeds) == pytest.approx(-0.02, abs=1e-8)
    assert np.all(log_errors(safe, positions, ways, speeds) <= -0.02)


def test_between_directions_a_safe_fit_is_safer_the_more_there_are():
    positions, across = grid(3), units(90)
    truth = arm_maxima(positions, across)
    few, many = (
        fit_errors(
            fit_ellipsoids(positions, units(k), arm_maxima(positions, units(k)), safe=True), positions, across, truth
        )
        for k in (8, 32)
    )
    assert few.overestimate > 0.1  # sixteen directions around the circle, as in the paper
    assert many.overestimate < 0.05


# --- the paper's form --------------------------------------------------------------------------------------------


def axes_field(*, turn):
    """Radii and an angle that are polynomials themselves; the angle passes ±90°, where eigenvectors jump."""
    numbers = np.array([[2.0, 1.0, 1.5], [0.3, -0.1, turn], [0.2, 0.2, 0.4], [0.1, 0, 0.1], [0, 0.1, 0], [0, 0, 0.2]])
    center = np.array([0.15, -0.15])
    axes = Polynomials(degree=2, center=center, scale=0.05, coefficients=numbers)
    return AxesEllipses(axes=axes, lower=center - 0.05, upper=center + 0.05)


def test_axes_that_are_polynomials_come_back_with_angles_continued():
    truth = axes_field(turn=0.8)
    speeds = truth.speeds(grid(5), units(8))
    inside = within(truth, 30)
    fitted = fit_axes(grid(5), units(8), speeds)
    assert fitted.speeds(inside, units(7)) == pytest.approx(truth.speeds(inside, units(7)), rel=1e-6)


def test_roots_of_axes_have_these_axes_and_the_derivatives_of_differences():
    model = axes_field(turn=0.8)
    positions = within(model, 30)
    (a, b, c), (roots, slopes) = model.axes(positions)[0].T, model.roots(positions)
    for radius, angle in ((a, c), (b, c + np.pi / 2)):
        along = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        assert np.einsum("nij,nj->ni", roots, along) == pytest.approx(along / radius[:, None])
    assert slopes == pytest.approx(differences(lambda p: model.roots(p)[0], positions), abs=1e-6)


def test_where_ellipses_turn_around_a_position_an_angle_cannot_follow():
    entries = np.array([[1.0, 0, 0, 1.0], [1.0, 0, 0, -1.0], [0, 1.0, 1.0, 0]])  # half a turn of c around the center
    center = np.array([0.15, -0.15])
    logs = Polynomials(degree=1, center=center, scale=0.05, coefficients=entries)
    truth = LogEllipsoids(logs=logs, lower=center - 0.05, upper=center + 0.05)
    samples = (grid(4), units(8), truth.speeds(grid(4), units(8)))
    inside = within(truth, 100)
    held_out = (inside, units(8), truth.speeds(inside, units(8)))
    assert fit_errors(fit_ellipsoids(*samples), *held_out).rms < 1e-9
    assert fit_errors(fit_axes(*samples), *held_out).rms > 0.1


def test_a_radius_below_zero_is_refused_with_its_position():
    model = axes_field(turn=0.8)
    with pytest.raises(InvalidInput, match=re.escape("b = -")) as caught:
        model.roots(np.array([[0.15, -0.15], [0.75, -0.35]]))
    assert "at [0.75 -0.35] m" in str(caught.value)


# --- errors of fits ----------------------------------------------------------------------------------------------


def test_errors_are_shares_of_the_true_speed_and_say_where():
    model, ways = field(2), units(4)
    positions = within(model, 3)
    factor = np.ones((3, 4))
    factor[1, 2], factor[2, 0] = 1 / 1.25, 2.0
    found = fit_errors(model, positions, ways, factor * model.speeds(positions, ways))
    assert found.overestimate == pytest.approx(0.25)
    assert found.underestimate == pytest.approx(0.5)
    assert found.rms == pytest.approx(np.sqrt((0.25**2 + 0.5**2) / 12))
    assert np.all(found.position == positions[1])
    assert np.all(found.direction == ways[2])


# --- what cannot be used -----------------------------------------------------------------------------------------


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
        (lambda p, d, v: ("here", d, v), "positions: a table of numbers wanted, got str"),
        (lambda p, d, v: (p * np.nan, d, v), "positions: finite numbers wanted, got nan in row 0, column 0"),
        (lambda p, d, v: (p, d[[0, 0, 4]], v[:, :3]), "got 3 that determine 2 of its 3 numbers"),
        (lambda p, d, v: (p, d[[0, 3]], v[:, :2]), "directions: at least 3 wanted that determine an ellipsoid"),
        (lambda p, d, v: (p[:5], d, v[:5]), "positions: at least 6 wanted for polynomials of degree 2 in 2"),
        (lambda p, d, v: (p * [1, 0], d, v), "in general position, got 9 that tell only 3 of 6 terms apart"),
        (lambda p, d, v: (p[[0] * 9], d, v), "in general position, got 9 that tell only 1 of 6 terms apart"),
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


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"degree": -1}, "degree: an integer of at least 0 wanted, got -1"),
        ({"margin": -0.1, "safe": True}, "margin: a finite number from 0 on wanted"),
        ({"margin": np.nan, "safe": True}, "margin: must be finite"),
        ({"margin": 0.1}, "and 0 unless safe, got 0.1"),
    ],
)
def test_settings_that_mean_nothing_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=re.escape(message)):
        fit_ellipsoids(grid(3), units(8), np.ones((9, 8)), **settings)


def test_spatial_positions_have_no_axes_and_no_planar_errors():
    positions, ways = np.random.default_rng(0).normal(size=(12, 3)), units(8, task=3)
    with pytest.raises(InvalidInput, match="positions: two coordinates wanted for ellipses, got 3"):
        fit_axes(positions, ways, np.ones((12, 8)))
    with pytest.raises(InvalidInput, match="positions: 2 coordinates wanted, got 3"):
        fit_errors(field(2), positions, ways, np.ones((12, 8)))


def test_speeds_that_only_an_endless_needle_is_near_to_are_refused():
    speeds = np.ones((9, 3))
    speeds[:, :2] = 10.0  # three directions, in one of which no ellipse through the others is that slow
    with pytest.raises(SolverFailed, match=r"at position \d one grew to \S+: give more directions"):
        fit_ellipsoids(grid(3), units(3), speeds)
