"""Directions against each other, as a pymoo problem: a posture that is fast one way is slow another way.

An individual is a posture at the position, the sliders, and how joints share the work in every direction. All are held
against the motors' curves at once.

Source: Kim, Choi & Jang 2021, Eq. 1, which maximises one direction at a time, each with a posture of its own; that one
posture serves several, and that power is weighed against speed, is new.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from pymoo.core.problem import Problem

from paretoik.arrays import Genes
from paretoik.capability.actuation import Actuation, DistributedActuation, check_actuation
from paretoik.capability.directional import unit_directions
from paretoik.capability.directional_program import DirectionalProgram
from paretoik.capability.joint_capability import values_at
from paretoik.capability.posture_samples import sample_holdable_postures, stationary_task
from paretoik.errors import InvalidInput, check_size
from paretoik.formulations.configurations import Configuration, Configurations
from paretoik.formulations.dense_points import dense_cold_search, dense_front_points, dense_individuals
from paretoik.formulations.protocol import Individuals
from paretoik.formulations.violations import explain_worst
from paretoik.front.front import Front
from paretoik.inputs import finite_array
from paretoik.nlp.dense import DenseProgram
from paretoik.nlp.program import Solver
from paretoik.pareto.cold_search import StartSearch
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import gravity_torques
from paretoik.self_motion.inverse_kinematics import wrap_difference
from paretoik.task.retraction import ON_PATH_TOLERANCE, retract


@dataclass(frozen=True, kw_only=True)
class GeneRanges:
    """How far genes reach."""

    self_motion: float = 1.0
    """How far from its base a posture may be along each direction of self-motion [rad, m]."""
    speed: float = 1.0
    """How fast joints may move along the self-motion meanwhile, as a share of the mean range of joint speeds."""


RANGES = GeneRanges()


class DirectionalMaxima(Problem):  # type: ignore[misc]  # pymoo is not typed
    """Find postures (and sliders) that are fast along several directions at once: a vectorised pymoo problem.

    Objectives: ``speed_1``, ``speed_2``, ..., how fast the tool can go along each direction from one posture with its
    sliders where they are [m/s], maximised; with ``power``, ``joint_power``, the most power that joints give or take
    meanwhile, the sum over them without signs [W]. ``pk.refine`` refines them by exact gradients over posture,
    sliders and speeds.

    Parameters
    ----------
    arm, actuation, position
        As ``directional_maxima`` takes them.
    directions
        Vectors (directions, task), or how many evenly around or over the sphere; at least one.
    power
        Whether power is an objective.
    starts, seed
        Postures that bases are taken from, and the seed of their chance; part of the problem.

    Genes: place among the bases, self-motion about it, a share of each front slider's way, for each direction the pace
    as a share of the fastest, and how much joints move along the self-motion meanwhile.

    Raises
    ------
    InvalidInput, Infeasible
        As ``directional_maxima`` does.
    """

    constraint_names = ("position", "joint limits", "motors", "sliders", "shares of joints")
    constraint_units = ("", "rad or m", "", "of the rod", "of the mean range of speeds")

    def __init__(
        self,
        arm: Arm,
        actuation: Actuation,
        position: object,
        directions: object,
        *,
        power: bool = True,
        starts: int = 400,
        seed: int = 0,
    ) -> None:
        check_actuation(actuation, arm)
        check_size("starts", starts, 1)
        check_size("seed", seed, 0)
        if not isinstance(power, bool):
            raise InvalidInput(f"power: True or False wanted, got {power!r}")
        self.arm, self.actuation, self.power = arm, actuation, power
        task = 2 if arm.is_planar else 3
        self.position = finite_array("position", position, (task,))
        self.directions = unit_directions(directions, task)
        count = len(self.directions)
        self.names: Sequence[str] = (*(f"speed_{k + 1}" for k in range(count)), *(("joint_power",) if power else ()))
        self.units: Sequence[str] = (*("m/s",) * count, *(("W",) if power else ()))
        self.maximised: Sequence[bool] = (*(True,) * count, *((False,) if power else ()))
        self.still = stationary_task(arm, self.position)
        self.configurations = Configurations(arm=arm, actuation=actuation, still=self.still, directions=self.directions)
        postures = sample_holdable_postures(arm, actuation, self.position, starts, np.random.default_rng(seed))
        self.bases = self.configurations.bases(postures)
        free = self.still.redundancy
        slides = arm.dof * isinstance(actuation, DistributedActuation)
        beside, mixed = np.full(free, RANGES.self_motion), np.full(count * free, RANGES.speed)
        low = np.concatenate([[0.0], -beside, np.zeros(slides + count), -mixed])
        high = np.concatenate([[1.0], beside, np.ones(slides + count), mixed])
        super().__init__(
            n_var=len(low), n_obj=len(self.names), n_ieq_constr=len(self.constraint_names), xl=low, xu=high
        )

    @cached_property
    def frames(self) -> tuple[np.ndarray, np.ndarray]:
        """Directions across the self-motion at every base (bases, dof, rows), and along it (bases, dof, redundancy)."""
        return self.configurations.frames(self.bases)

    def sample_starts(self, count: int, rng: np.random.Generator) -> Genes:
        """Return genes of bases as fast as they can go, sliders anywhere."""
        rows = np.zeros((count, self.n_var))
        part = self._parts(rows)  # views
        part["place"][:, 0] = (rng.integers(len(self.bases), size=count) + 0.5) / len(self.bases)
        part["front"][:] = rng.uniform(size=part["front"].shape)
        part["pace"][:] = 1.0
        return rows

    def configuration(self, genes: Genes) -> Configuration:
        """Return the postures, sliders and speeds of genes (points, n_var)."""
        part = self._parts(genes)
        which = np.minimum((part["place"][:, 0] * len(self.bases)).astype(int), len(self.bases) - 1)
        across, along = (each[which] for each in self.frames)
        base = self.bases[which] + np.einsum("pjr,pr->pj", along, part["beside"])
        targets = np.repeat(self.still.targets[:1], len(genes), axis=0)
        retracted = retract(self.arm, self.still.tasks, base, targets, across)
        front = np.zeros_like(retracted.q)
        if isinstance(self.actuation, DistributedActuation):
            low, high = self.actuation.front_bounds.T
            front = low + part["front"] * (high - low)
        mixed = part["mixed"].reshape(len(genes), len(self.directions), -1)
        off_path = retracted.error > ON_PATH_TOLERANCE
        return self.configurations.with_speeds(retracted.q, front, part["pace"], mixed, off_path)

    def program(self, scales: Float[np.ndarray, " n_obj"] | None = None) -> DenseProgram:
        """Return the nonlinear program of posture, sliders and speeds, its objectives divided by ``scales``."""
        program = self._unscaled
        costs = np.zeros((self.n_obj, program.unknowns))
        count = len(self.directions)
        costs[np.arange(count), np.arange(program.unknowns)[program.slices["values"]]] = -self.size
        if self.power:
            costs[count, program.slices["power"]] = 1.0
        divisors = np.ones(self.n_obj) if scales is None else scales
        return DenseProgram(
            rows=program.program(self.position, self.directions, self.size),
            costs=costs / divisors[:, None],
            objective_names=tuple(self.names),
        )

    def front_points(self, front: Front) -> Float[np.ndarray, "points unknowns"]:
        """Return the points of a front's genes."""
        return dense_front_points(self, front)

    def individuals(self, x: Float[np.ndarray, "points unknowns"], genes: Genes | None = None) -> Individuals:
        """Return points as individuals, with genes that stand for them."""
        return dense_individuals(self, x, genes)

    def branches(self, x: Float[np.ndarray, "points unknowns"]) -> list[str]:
        """Return the number of the base that each point is nearest to."""
        return [str(int(place * len(self.bases))) for place in self.genes(x)[:, 0]]

    def cold_search(
        self, *, starts: int, seed: int, solver: Solver = "auto", observe: Callable[[int, int], object] | None = None
    ) -> StartSearch:
        """Return how optima are found from nothing: from so many starts, each by itself."""
        return dense_cold_search(self, starts=starts, seed=seed, solver=solver, observe=observe)

    @cached_property
    def size(self) -> float:
        """The highest speed of the bases along any direction [m/s]."""
        speeds = values_at(self.arm, self.actuation, self.directions, "velocity", self.bases)
        return float(np.nanmax(speeds))

    def points(self, genes: Genes) -> Float[np.ndarray, "points unknowns"]:
        """Return the unknowns of the smooth program at genes."""
        at, program = self.configuration(genes), self._unscaled
        z = np.zeros((len(genes), program.unknowns))
        z[:, program.slices["q"]] = at.q
        torque = gravity_torques(self.arm, at.q)
        motors = at.dq[:, :, None]
        if isinstance(self.actuation, DistributedActuation):
            z[:, program.slices["front"]] = at.front
            motors = self.configurations.slider_speeds(at, torque)
        z[:, program.slices["motors"]] = motors.reshape(len(genes), -1)
        z[:, program.slices["values"]] = at.speeds
        if self.power:
            work = np.abs(torque[:, None] * at.dq)
            z[:, program.slices["work"]] = work.reshape(len(genes), -1)
            z[:, program.slices["power"]] = work.sum(axis=-1).max(axis=1, keepdims=True)
        return z / program.scale(self.size)

    def genes(self, x: Float[np.ndarray, "points unknowns"]) -> Genes:
        """Return the genes of unknowns, or the nearest within their bounds."""
        parts = [self._unscaled.parts(one, self.size) for one in x]
        q, speeds = (np.array([part[name] for part in parts]) for name in ("q", "values"))
        differences = wrap_difference(q[:, None] - self.bases, self.arm.periodic)
        which = np.linalg.norm(differences, axis=2).argmin(axis=1)
        beside = np.einsum("pjr,pj->pr", self.frames[1][which], differences[np.arange(len(q)), which])
        genes, front = [((which + 0.5) / len(self.bases))[:, None], beside], np.zeros_like(q)
        motors = np.array([part["motors"] for part in parts])
        if isinstance(self.actuation, DistributedActuation):
            front = np.array([part["front"] for part in parts])
            low, high = self.actuation.front_bounds.T
            genes.append(np.clip((front - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0))
        dq = (self.actuation.ratios(q, front)[:, None] * motors).sum(axis=2)
        fastest, ranges, free = self.configurations.fastest(q, front)
        pace = np.clip(speeds / np.where(fastest.speeds > 0, fastest.speeds, 1.0), 0.0, 1.0)
        along = (dq - pace[..., None] * fastest.dq) / ranges[:, None, None]
        genes += [pace, np.einsum("pjr,pkj->pkr", free, along).reshape(len(q), -1)]
        clipped: Genes = np.clip(np.concatenate(genes, axis=1), self.xl, self.xu)
        return clipped

    def violation_between(self, genes: Genes) -> Float[np.ndarray, " points"]:
        """Return 0 (points,): a posture has nothing between samples."""
        return np.zeros(len(genes))

    def fingerprint_parts(self) -> list[object]:
        """Return what makes genes mean what they mean: arm, motors, position, directions, bases."""
        arm = self.arm
        bodies = [np.concatenate([[body.mass], body.center]) for body in arm.bodies]
        parts = [self.actuation.table, self.position, self.directions, self.bases, self.names, arm.position_limits]
        return [*parts, arm.joint_names, arm.gravity, arm.tool.position, *bodies]

    def explain(self, genes: Genes) -> list[str]:
        """Return for each individual which limit is violated most, in words; "" where none is."""
        return explain_worst(self.constraint_names, self.constraint_units, self.configuration(genes).excess)

    @cached_property
    def _unscaled(self) -> DirectionalProgram:
        return DirectionalProgram(
            arm=self.arm,
            actuation=self.actuation,
            quantity="velocity",
            count=len(self.directions),
            power=self.power,
        )

    def _parts(self, genes: Genes) -> dict[str, np.ndarray]:
        """Return the genes by name."""
        free, count = self.still.redundancy, len(self.directions)
        slides = self.arm.dof * isinstance(self.actuation, DistributedActuation)
        sizes = {"place": 1, "beside": free, "front": slides, "pace": count, "mixed": count * free}
        ends = np.cumsum([0, *sizes.values()])
        return {name: genes[:, a:b] for name, a, b in zip(sizes, ends[:-1], ends[1:], strict=True)}

    def _evaluate(self, X: Genes, out: dict[str, object], *args: object, **kwargs: object) -> None:
        at = self.configuration(X)
        bad = ~np.isfinite(at.power).all(axis=1)
        values = [-at.speeds, at.power.max(axis=1, keepdims=True)] if self.power else [-at.speeds]
        out["F"] = np.where(bad[:, None], 0.0, np.concatenate(values, axis=1))
        out["G"] = np.where(np.isnan(at.excess), 1.0, at.excess)
