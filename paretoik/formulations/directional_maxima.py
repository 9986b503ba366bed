"""Directions against each other, as a pymoo problem: a posture that is fast or strong one way is not so another way.

An individual is a posture at the position, the sliders, and how joints share the work in every direction. All are held
against the motors' curves at once.

Source: Kim, Choi & Jang 2021, Eq. 1, which maximises one direction at a time, each with a posture of its own; that one
posture serves several, that power is weighed against speed, and speed against force, is new. Chiu, Task Compatibility
of Manipulator Postures, 1988, weighs speed against force by ellipsoids.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Genes
from paretoik.call_arguments import check_call
from paretoik.capability.actuation import Actuation, DistributedActuation, check_actuation
from paretoik.capability.directional import unit_directions
from paretoik.capability.directional_program import DirectionalProgram, consecutive_slices
from paretoik.capability.joint_capability import Quantity, quantities_along
from paretoik.capability.posture_samples import sample_holdable_postures, stationary_task
from paretoik.errors import InvalidInput
from paretoik.formulations.configurations import Configuration, Configurations
from paretoik.formulations.dense_formulation import DenseFormulation, front_sliders, slider_shares
from paretoik.formulations.formulation import of_genes
from paretoik.formulations.own_functions import WholeProgram, function_task
from paretoik.inputs import check_flag, check_seed, check_size, finite_array, read_list
from paretoik.nlp.dense import DenseProgram
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import gravity_torques
from paretoik.self_motion.start_postures import wrap_difference
from paretoik.task.evaluation import evaluate_motions, examine_functions, require_values
from paretoik.task.limits import LIMIT_TOLERANCE, Constraint
from paretoik.task.motion import Motion
from paretoik.task.objectives import Objective
from paretoik.task.retraction import ON_PATH_TOLERANCE, retract


@dataclass(frozen=True, kw_only=True)
class GeneRanges:
    """How far genes reach."""

    self_motion: float = 1.0  # rad or m: of a posture from its base, along each direction of self-motion
    speed: float = 1.0  # share of the mean range of joint speeds: along the self-motion meanwhile


RANGES = GeneRanges()
NAMES: dict[Quantity, str] = {"velocity": "speed", "force": "force"}
UNITS: dict[Quantity, str] = {"velocity": "m/s", "force": "N"}


def _check_power(power: bool | None, quantities: Sequence[Quantity]) -> bool:
    """Return whether power is an objective; raise InvalidInput where nothing moves."""
    if power is None:
        return "velocity" in quantities
    check_flag("power", power)
    if power and "velocity" not in quantities:
        raise InvalidInput("power: False wanted with forces alone, since they take none at rest, got True")
    return bool(power)


@check_call
class DirectionalMaxima(DenseFormulation):
    """Find postures (and sliders) that are fast or strong along several directions at once: a vectorised pymoo problem.

    Objectives: ``speed_1``, ``speed_2``, ..., how fast the tool can go along each direction from one posture with its
    sliders where they are [m/s], maximised, or ``force_1``, ..., how hard it can push at rest [N]; with ``power``,
    ``joint_power``, the most power that joints give or take at these speeds, the sum over them without signs [W]; then
    a user's own. ``pk.refine`` refines them by exact gradients over posture, sliders and speeds. The motions of its
    fronts stand still in their postures. Where a posture stretches the arm along a direction its forces have no bounds.

    Parameters
    ----------
    arm, actuation, position
        As ``directional_maxima`` takes them.
    directions
        Vectors (directions, task), or how many evenly around or over the sphere; at least one.
    quantity
        "velocity" or "force", or a list of them, one a direction: what makes a posture fast makes it weak.
    power
        Whether power is an objective; None where there are speeds, since forces at rest take none.
    objectives, constraints
        A user's own, decorated with ``@objective`` and ``@constraint``, of any form. They see the motion that the front
        shows, three samples of an arm that stands in its posture for a second: velocities are 0, torques those of
        gravity, an integral or a mean over time is what it is a second.
    starts, seed
        Postures that bases are taken from, and the seed of their chance; part of the problem.

    Genes: place among the bases, self-motion about it, a share of each front slider's way, for each speed the pace as a
    share of the fastest, and how much joints move along the self-motion meanwhile.

    Raises
    ------
    InvalidInput, Infeasible
        As ``directional_maxima`` does.
    """

    computed_attributes = ("bases", "sizes")
    constraint_names: tuple[str, ...] = ("position", "joint limits", "motors", "sliders", "shares of joints")
    constraint_units: tuple[str, ...] = ("", "rad or m", "", "of the rod", "of the mean range of speeds")

    def __init__(
        self,
        arm: Arm,
        actuation: Actuation,
        position: object,
        directions: object,
        *,
        quantity: Quantity | Sequence[Quantity] = "velocity",
        power: bool | None = None,
        objectives: Sequence[Objective] = (),
        constraints: Sequence[Constraint] = (),
        starts: int = 400,
        seed: int = 0,
    ) -> None:
        """Make the problem; the class says of what."""
        read_list("objectives", objectives, Objective, "a list of functions decorated with @objective")
        check_actuation(actuation, arm)
        check_size("starts", starts, 1)
        check_seed("seed", seed)
        self.arm, self.actuation = arm, actuation
        task = 2 if arm.is_planar else 3
        self.position = finite_array("position", position, (task,))
        self.directions = unit_directions(directions, task)
        count = len(self.directions)
        quantities = quantities_along(quantity, count)
        self.power = _check_power(power, quantities)
        self.names = (*(f"{NAMES[each]}_{k + 1}" for k, each in enumerate(quantities)), *("joint_power",) * self.power)
        self.units = (*(UNITS[each] for each in quantities), *("W",) * self.power)
        self.maximised = (*(True,) * count, *(False,) * self.power)
        self.stationary = stationary_task(arm, self.position)
        self.add_functions(function_task(arm, self.stationary.tasks[0].path, objectives, constraints))
        self.configurations = Configurations(
            arm=arm,
            actuation=actuation,
            stationary=self.stationary,
            directions=self.directions,
            quantities=quantities,
        )
        postures = sample_holdable_postures(arm, actuation, self.position, starts, np.random.default_rng(seed))
        self.bases = self.configurations.bases(postures)
        self.base_count, self.sizes = len(self.bases), self.configurations.sizes(self.bases)
        sizes = list(self._gene_counts.values())
        low = np.repeat([0.0, -RANGES.self_motion, 0.0, 0.0, -RANGES.speed], sizes)
        high = np.repeat([1.0, RANGES.self_motion, 1.0, 1.0, RANGES.speed], sizes)
        super().__init__(
            n_var=len(low), n_obj=len(self.names), n_ieq_constr=len(self.constraint_names), xl=low, xu=high
        )
        self._check_functions()

    def _check_functions(self) -> None:
        """Raise for functions without values, and InvalidInput for an objective that is the same in all postures."""
        motions = self._motions(self.bases)
        for objective, values in zip(self.functions.objectives, require_values(self.functions, motions).T, strict=True):
            if len(values) > 1 and np.ptp(values) == 0:
                raise InvalidInput(
                    f"{objective.name}: a function of the posture wanted, got one that is the same in all: the arm "
                    "stands still"
                )
        examine_functions(self.functions, motions)

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
        which = self.base_indices(genes)
        across, along = (each[which] for each in self.frames)
        base = self.bases[which] + np.einsum("pjr,pr->pj", along, part["self_motion"])
        retracted = retract(self.arm, self.stationary.tasks, base, self.stationary.targets[0], across)
        front = front_sliders(self.actuation, part["front"])
        pace = part["pace"]
        joint_shares = part["joint_shares"].reshape(*pace.shape, self.stationary.redundancy)
        off_path = retracted.error > ON_PATH_TOLERANCE
        return self.configurations.at_pace(retracted.q, front, pace, joint_shares, off_path)

    @of_genes
    def decode(self, genes: Genes) -> Motion:
        """Return motions (points, 3, dof) that stand still in the postures of genes."""
        return self._motions(self.configuration(genes).q)

    def _motions(self, q: Float[np.ndarray, "points dof"]) -> Motion:
        return self.functions.motion(np.repeat(q[:, None], len(self.functions.times), axis=1))

    def program(self, scales: Float[np.ndarray, " n_obj"] | None = None) -> DenseProgram:
        """Return the nonlinear program of posture, sliders and speeds, its objectives divided by ``scales``."""
        divisors = np.ones(self.n_obj) if scales is None else scales
        whole = self._whole_program
        return DenseProgram(rows=whole.rows, costs=whole.costs / divisors[:, None], objective_names=self.names)

    @cached_property
    def _whole_program(self) -> WholeProgram:
        program, count = self._unscaled, len(self.directions)
        costs = np.zeros((count + self.power, program.unknowns))
        costs[np.arange(count), np.arange(program.unknowns)[program.slices["values"]]] = -self.sizes
        if self.power:
            costs[count, program.slices["power"]] = 1.0
        return WholeProgram(
            base=program.program(self.position, self.directions, self.sizes),
            base_costs=costs,
            task=self.functions,
            near=self._motions(self.bases),
            lanes=program.posture_lanes(len(self.functions.times)),
            intervals=np.arange(0),
        )

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
        z[:, program.slices["motors"]] = motors.reshape(len(genes), math.prod(motors.shape[1:]))
        z[:, program.slices["values"]] = at.values
        if self.power:
            work = np.abs(torque[:, None] * at.dq)
            z[:, program.slices["work"]] = work.reshape(len(genes), -1)
            z[:, program.slices["power"]] = work.sum(axis=-1).max(axis=1, keepdims=True)
        return np.concatenate(
            [z / program.scale(self.sizes), self._whole_program.own.values(self._motions(at.q))], axis=1
        )

    def genes(self, x: Float[np.ndarray, "points unknowns"]) -> Genes:
        """Return the genes of unknowns, or the nearest within their bounds."""
        parts = [self._unscaled.parts(one[: self._unscaled.unknowns], self.sizes) for one in x]
        q, values = (np.array([part[name] for part in parts]) for name in ("q", "values"))
        differences = wrap_difference(q[:, None] - self.bases, self.arm.periodic)
        which = np.linalg.norm(differences, axis=2).argmin(axis=1)
        self_motion = np.einsum("pjr,pj->pr", self.frames[1][which], differences[np.arange(len(q)), which])
        genes, front = [((which + 0.5) / len(self.bases))[:, None], self_motion], np.zeros_like(q)
        motors = np.array([part["motors"] for part in parts])
        if isinstance(self.actuation, DistributedActuation):
            front = np.array([part["front"] for part in parts])
            genes.append(np.clip(slider_shares(self.actuation, front), 0.0, 1.0))
        dq = (self.actuation.ratios(q, front)[:, None] * motors).sum(axis=2)
        best, ranges, free = self.configurations.maxima(q, front)
        speeds, fastest = (each[:, self.configurations.moving] for each in (values, best.values))
        pace = np.clip(speeds / np.where(fastest > 0, fastest, 1.0), 0.0, 1.0)
        along = (dq - pace[..., None] * best.dq) / ranges[:, None, None]
        joint_shares = np.einsum("pjr,pkj->pkr", free, along)
        genes += [pace, joint_shares.reshape(len(q), math.prod(joint_shares.shape[1:]))]
        clipped: Genes = np.clip(np.concatenate(genes, axis=1), self.xl, self.xu)
        return clipped

    @cached_property
    def _unscaled(self) -> DirectionalProgram:
        return DirectionalProgram(
            arm=self.arm,
            actuation=self.actuation,
            quantities=self.configurations.quantities,
            power=self.power,
        )

    @cached_property
    def _gene_counts(self) -> dict[str, int]:
        """How many genes there are of each kind, in order."""
        free, speeds = self.stationary.redundancy, int(self.configurations.moving.sum())
        slides = self.arm.dof * isinstance(self.actuation, DistributedActuation)
        return {"place": 1, "self_motion": free, "front": slides, "pace": speeds, "joint_shares": speeds * free}

    def _parts(self, genes: Genes) -> dict[str, np.ndarray]:
        """Return the genes by name."""
        return {name: genes[:, place] for name, place in consecutive_slices(self._gene_counts).items()}

    def _evaluate(self, X: Genes, out: dict[str, object], *args: object, **kwargs: object) -> None:
        at = self.configuration(X)
        own, limits, causes = evaluate_motions(self.functions, self._motions(at.q), interruptible=False)
        unbounded = np.isinf(at.values).any(axis=1)
        out["cause"] = np.where(unbounded, "a force that no joint has to bear is without bounds", causes)
        failed = (~np.isfinite(own).all(axis=1) | unbounded)[:, None]
        invalid = failed | ~np.isfinite(at.power).all(axis=1, keepdims=True)
        power = at.power.max(axis=1, keepdims=True, initial=0.0)[:, : int(self.power)]
        G = np.concatenate([at.excess, limits - LIMIT_TOLERANCE], axis=1)
        out["F"] = np.where(invalid, 0.0, np.concatenate([-at.values, power, own], axis=1))
        out["G"] = np.where(np.isnan(G), 1.0, np.where(failed, np.maximum(G, 1e-3), G))
