"""Trade-offs between speeds or forces in several directions, as a pymoo problem.

An individual has a posture of the arm, positions of the sliders, and joint velocities for each direction. All
individuals are checked against the motors' curves at once.

Sources: Kim, Choi & Jang 2021, Eq. 1, maximises one direction at a time, each with its own posture. New here: one
posture serves several directions, power is weighed against speed, and speed against force. Chiu, Task Compatibility of
Manipulator Postures, 1988, weighs speed against force by ellipsoids.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from paretoik.arrays import Genes, Joints
from paretoik.capability.actuation import Actuation, DistributedActuation, check_actuation
from paretoik.capability.directional import unit_directions
from paretoik.capability.directional_program import DirectionalProgram, consecutive_slices
from paretoik.capability.joint_capability import OPTIONS as FACETS
from paretoik.capability.joint_capability import (
    Quantity,
    fastest_joint_speeds,
    greatest_forces,
    motor_speeds,
    quantities_along,
    speeds_at_sliders,
    torque_capacity,
    torques_at_sliders,
    values_at,
)
from paretoik.capability.postures import sample_holdable_postures, stationary_task
from paretoik.errors import InvalidInput
from paretoik.formulations.dense_formulation import (
    DenseFormulation,
    WholeProgram,
    front_sliders,
    function_task,
    slider_shares,
)
from paretoik.formulations.formulation import of_genes
from paretoik.inputs import check_flag, check_seed, check_size, finite_array
from paretoik.robot import kinematics
from paretoik.robot.arm import Arm
from paretoik.robot.dynamics import gravity_torques
from paretoik.task.limits import LIMIT_TOLERANCE, Constraint
from paretoik.task.motion import Motion
from paretoik.task.motion_task import evaluate_motions, examine_functions, require_values
from paretoik.task.objectives import Objective
from paretoik.task.random_starts import order_by_neighbour, wrap_difference
from paretoik.task.retraction import ON_PATH_TOLERANCE, retract, task_errors


@dataclass(frozen=True, kw_only=True, eq=False)
class Configuration:
    """Decoded genes: postures, sliders, and speeds or forces per direction."""

    q: Float[np.ndarray, "points dof"]  # rad, m
    front: Float[np.ndarray, "points dof"]  # m: positions of front sliders; 0 without sliders
    values: Float[np.ndarray, "points directions"]  # m/s or N; inf if a force loads no joint
    dq: Float[np.ndarray, "points speeds dof"]  # rad/s, m/s: joint velocities for the speeds
    power: Float[np.ndarray, "points speeds"]  # W: power that the joints need for the speeds
    excess: Float[np.ndarray, "points limits"]  # violations in the units of ``constraint_units``


@dataclass(frozen=True, kw_only=True, eq=False)
class Maxima:
    """Highest speeds and forces of postures, with the joint quantities that give them."""

    values: Float[np.ndarray, "points directions"]  # m/s or N; inf if a force loads no joint
    dq: Float[np.ndarray, "points speeds dof"]  # rad/s, m/s: joint velocities for the speeds
    torque: Float[np.ndarray, "points dof"]  # torques that hold the arm
    low: Float[np.ndarray, "points dof"]  # lowest joint speeds; 0 if a motor cannot hold the arm
    high: Float[np.ndarray, "points dof"]  # highest joint speeds; 0 if a motor cannot hold the arm
    holds: Bool[np.ndarray, " points"]  # whether all motors can hold the posture
    span: Float[np.ndarray, " points"]  # mean range of joint speeds
    free: Float[np.ndarray, "points dof redundancy"]  # directions of the self-motion


# Trade-offs between directions as a pymoo problem.


@dataclass(frozen=True, kw_only=True)
class GeneRanges:
    """Ranges of the genes."""

    self_motion: float = 1.0  # rad or m: distance from the base along each direction of self-motion
    speed: float = 1.0  # speed along the self-motion, as a share of the mean range of joint speeds


RANGES = GeneRanges()
NAMES: dict[Quantity, str] = {"velocity": "speed", "force": "force"}
UNITS: dict[Quantity, str] = {"velocity": "m/s", "force": "N"}


class DirectionalMaxima(DenseFormulation):
    """Find postures that are fast or strong along directions: a pymoo problem.

    A posture includes the positions of sliders, if any. The problem is vectorised.

    Objectives:

    - ``speed_1``, ...: the tool's highest speed along each direction [m/s], maximised
    - ``force_1``, ...: the tool's greatest force at rest along each direction [N], maximised
    - ``joint_power``, if ``power``: sum of the joints' absolute power [W], the largest over directions
    - the user's own

    ``pk.refine`` refines fronts by exact gradients over posture, sliders and speeds. Their motions stand still in the
    postures. If the arm is stretched along a direction, forces along it have no bounds.

    Parameters
    ----------
    arm
        Arm, as in ``directional_maxima``.
    actuation
        Motors or sliders that drive the arm, as in ``directional_maxima``.
    position
        Position of the tool (task,) [m], as in ``directional_maxima``.
    directions
        Vectors (directions, task), or the number of directions, spread evenly over the circle or sphere.
    quantity
        Quantity along all directions, "velocity" or "force", or a list with one per direction.
    power
        Flag: whether power is an objective; None: True if there are speeds (forces at rest take no power).
    objectives
        User's functions decorated with ``@objective``, of any form. Their motions have three samples: the arm stands
        in its posture for one second. Velocities are 0, and torques are those of gravity.
    constraints
        User's functions decorated with ``@constraint``, of any form; their motions are the same.
    starts
        Number of sampled postures from which bases are chosen; genes depend on it.
    seed
        Seed of the sampled postures; genes depend on it.

    Notes
    -----
    Genes: the base, the self-motion from it, the position of each front slider as a share of its range, each speed as a
    share of the highest, and the joint velocities along the self-motion at that speed.

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
        check_actuation(actuation, arm)
        check_size("starts", starts, 1)
        check_seed("seed", seed)
        self.arm, self.actuation = arm, actuation
        task = 2 if arm.is_planar else 3
        self.position = finite_array("position", position, (task,))
        self.directions = unit_directions(directions, task)
        count = len(self.directions)
        self.quantities = quantities = quantities_along(quantity, count)
        if power is not None:
            check_flag("power", power)
        if power and "velocity" not in quantities:
            raise InvalidInput("power must be False if all quantities are forces, got True")
        self.power = "velocity" in quantities if power is None else bool(power)
        self.names = (*(f"{NAMES[each]}_{k + 1}" for k, each in enumerate(quantities)), *("joint_power",) * self.power)
        self.units = (*(UNITS[each] for each in quantities), *("W",) * self.power)
        self.maximised = (*(True,) * count, *(False,) * self.power)
        self.stationary = stationary_task(arm, self.position)
        self.add_functions(function_task(arm, self.stationary.tasks[0].path, objectives, constraints))
        bases = list[np.ndarray]()  # postures at least 0.1 rad or m apart
        for posture in sample_holdable_postures(arm, actuation, self.position, starts, np.random.default_rng(seed)):
            distances = np.abs(wrap_difference(np.reshape(bases, (-1, arm.dof)) - posture, arm.periodic))
            if distances.max(axis=1).min(initial=np.inf) > 0.1:
                bases.append(posture)
        self.bases = order_by_neighbour(arm, np.array(bases))
        self.base_count, self.sizes = len(self.bases), self._largest_values(self.bases)
        sizes = list(self._gene_counts.values())
        low = np.repeat([0.0, -RANGES.self_motion, 0.0, 0.0, -RANGES.speed], sizes)
        high = np.repeat([1.0, RANGES.self_motion, 1.0, 1.0, RANGES.speed], sizes)
        super().__init__(low, high)
        motions = self._motions(self.bases)
        for each, values in zip(self.functions.objectives, require_values(self.functions, motions).T, strict=True):
            if len(values) > 1 and np.ptp(values) == 0:
                raise InvalidInput(
                    f"{each.name} must depend on the posture, got the same value in all: the arm stands still"
                )
        examine_functions(self.functions, motions)

    @cached_property
    def moving(self) -> Bool[np.ndarray, " directions"]:
        """Mask of the directions whose quantity is speed, not force."""
        return np.array([quantity == "velocity" for quantity in self.quantities])

    def _largest_values(self, q: Float[np.ndarray, "postures dof"]) -> Float[np.ndarray, " directions"]:
        """Return the highest speed [m/s] or force [N] over all directions and postures, per direction.

        Raises InvalidInput, naming the direction, if no motor limits the force along it.
        """
        sizes, moving = np.empty(len(self.directions)), self.moving
        if moving.any():
            sizes[moving] = np.nanmax(values_at(self.arm, self.actuation, self.directions[moving], "velocity", q))
        if moving.all():
            return sizes
        if not any(np.isfinite(curve.stall).any() for curve in self.actuation.curves):
            raise InvalidInput("actuation must have a motor with a finite stall, got none: nothing limits forces")
        columns = kinematics.jacobian(self.arm, q)[:, : self.directions.shape[1]]
        shares, lengths = np.abs(self.directions @ columns), np.linalg.norm(columns, axis=1)
        limited = np.isfinite(torque_capacity(self.actuation, q)[0])
        bears = ((shares > FACETS.orthogonal * lengths[:, None]) & limited[:, None]).any(axis=2)
        for k in np.flatnonzero(~moving & ~bears.any(axis=0)):
            raise InvalidInput(
                f"direction {k + 1} must load a motor of {self.arm.name}, got "
                f"{self.directions[k].round(4).tolist()}: no motor limits the force along it"
            )
        forces = values_at(self.arm, self.actuation, self.directions[~moving], "force", q)
        sizes[~moving] = forces[bears[:, ~moving]].max()
        return sizes

    def _frames_at(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return directions across (batch, dof, rows) and along (batch, dof, redundancy) the self-motion."""
        jacobian = task_errors(self.arm, self.stationary.tasks, q, self.stationary.targets[0])[1]
        basis = np.linalg.qr(jacobian.swapaxes(-1, -2), mode="complete")[0]
        return basis[..., : self.stationary.rows], basis[..., self.stationary.rows :]

    @cached_property
    def _base_frames(self) -> tuple[np.ndarray, np.ndarray]:
        return self._frames_at(self.bases)

    def maxima(self, q: Joints, front: Joints) -> Maxima:
        """Return postures' (points, dof) highest speed and force along each direction."""
        torque = gravity_torques(self.arm, q)
        low, high = speeds_at_sliders(self.actuation, q, torque, front)
        holds = ~np.isnan(high).any(axis=1)
        low, high = (np.where(holds[:, None], each, 0.0) for each in (low, high))
        columns = kinematics.jacobian(self.arm, q)[:, : self.directions.shape[1]]
        values, count = np.empty((len(q), len(self.directions))), int(self.moving.sum())
        # Speeds: max v subject to J dq = v d, low ≤ dq ≤ high.
        at_each, lowest, highest = (np.repeat(each, count, axis=0) for each in (columns, low, high))
        ways = np.tile(self.directions[self.moving], (len(q), 1))
        speeds, dq = fastest_joint_speeds(at_each, lowest, highest, ways)
        values[:, self.moving] = speeds.reshape(len(q), count)
        # Forces: max f subject to |f Jᵀ d + torque| ≤ capacity.
        capacity = np.where(holds[:, None], torques_at_sliders(self.actuation, q, front), np.abs(torque))
        downwards, upwards = np.minimum(-capacity - torque, 0.0), np.maximum(capacity - torque, 0.0)
        forces = greatest_forces(columns, downwards, upwards, self.directions[~self.moving])
        values[:, ~self.moving] = np.where(holds[:, None], forces, 0.0)
        return Maxima(
            values=values,
            dq=dq.reshape(len(q), count, q.shape[1]),
            torque=torque,
            low=low,
            high=high,
            holds=holds,
            span=np.maximum((high - low).mean(axis=1), 1e-12),
            free=self._frames_at(q)[1],
        )

    def sample_starts(self, count: int, rng: np.random.Generator) -> Genes:
        """Return genes of bases at their highest speeds, with random sliders."""
        rows = np.zeros((count, self.n_var))
        part = self._parts(rows)  # views
        part["place"][:, 0] = (rng.integers(len(self.bases), size=count) + 0.5) / len(self.bases)
        part["front"][:] = rng.uniform(size=part["front"].shape)
        part["pace"][:] = 1.0
        return rows

    def configuration(self, genes: Genes) -> Configuration:
        """Return the postures, sliders and speeds of genes (points, n_var), with violations.

        Forces are the greatest ones: smaller ones would save nothing.
        """
        part, actuation = self._parts(genes), self.actuation
        which = self.base_indices(genes)
        across, along = (each[which] for each in self._base_frames)
        base = self.bases[which] + np.einsum("pjr,pr->pj", along, part["self_motion"])
        retracted = retract(self.arm, self.stationary.tasks, base, self.stationary.targets[0], across)
        q, front, pace = retracted.q, front_sliders(actuation, part["front"]), part["pace"]
        best = self.maxima(q, front)
        # Joint speeds: shares of the highest ones, plus self-motion in units of the mean range of joint speeds.
        span, joint_shares = best.span[:, None, None], part["joint_shares"]
        joint_shares = joint_shares.reshape(*pace.shape, self.stationary.redundancy)
        dq = pace[..., None] * best.dq + span * np.einsum("pjr,pkr->pkj", best.free, joint_shares)
        values = best.values.copy()
        values[:, self.moving] *= pace
        lower, upper = self.arm.position_limits.T
        limit_excess = np.maximum(np.maximum(q - upper, lower - q).max(axis=1), -1.0)
        slider_excess = np.zeros(len(q))
        if isinstance(actuation, DistributedActuation):  # excess of back sliders, and of the sines of rods' angles
            back, angle = actuation.gears(q, front)[0], actuation.angles(q)
            low, high = actuation.back_bounds.T
            back_excess = np.maximum(back - high, low - back) / actuation.rod
            angle_excess = np.sin(actuation.least_angle) - np.sin(angle)
            slider_excess = np.maximum(back_excess, angle_excess).max(axis=1) - LIMIT_TOLERANCE
        speed_excess = np.maximum(dq - best.high[:, None], best.low[:, None] - dq) / span
        shares = np.where(best.holds, speed_excess.max(axis=(1, 2), initial=-1.0) - LIMIT_TOLERANCE, 0.0)
        off_path, unheld = (each.astype(float) for each in (retracted.error > ON_PATH_TOLERANCE, ~best.holds))
        return Configuration(
            q=q,
            front=front,
            values=values,
            dq=dq,
            power=np.abs(best.torque[:, None] * dq).sum(axis=-1),
            excess=np.stack([off_path, limit_excess, unheld, slider_excess, shares], axis=1),
        )

    def slider_speeds(self, at: Configuration, torque: np.ndarray) -> np.ndarray:
        """Return the slider speeds (points, directions, 2, dof) that give the joint speeds."""
        return motor_speeds(self.actuation, at.q[:, None], at.front[:, None], torque[:, None], at.dq)[0]

    @of_genes
    def decode(self, genes: Genes) -> Motion:
        """Return motions (points, 3, dof) that stand still in the postures of genes."""
        return self._motions(self.configuration(genes).q)

    def _motions(self, q: Float[np.ndarray, "points dof"]) -> Motion:
        return self.functions.motion(np.repeat(q[:, None], len(self.functions.times), axis=1))

    @cached_property
    def whole_program(self) -> WholeProgram:
        """Rows and costs of posture, sliders and speeds."""
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
        """Return the smooth program's unknowns for genes."""
        at, program = self.configuration(genes), self._unscaled
        z = np.zeros((len(genes), program.unknowns))
        z[:, program.slices["q"]] = at.q
        torque = gravity_torques(self.arm, at.q)
        motors = at.dq[:, :, None]
        if isinstance(self.actuation, DistributedActuation):
            z[:, program.slices["front"]] = at.front
            motors = self.slider_speeds(at, torque)
        z[:, program.slices["motors"]] = motors.reshape(len(genes), math.prod(motors.shape[1:]))
        z[:, program.slices["values"]] = at.values
        if self.power:
            work = np.abs(torque[:, None] * at.dq)
            z[:, program.slices["work"]] = work.reshape(len(genes), -1)
            z[:, program.slices["power"]] = work.sum(axis=-1).max(axis=1, keepdims=True)
        return np.concatenate(
            [z / program.scale(self.sizes), self.whole_program.own.values(self._motions(at.q))], axis=1
        )

    def genes(self, x: Float[np.ndarray, "points unknowns"]) -> Genes:
        """Return the genes of unknowns, or the nearest within their bounds."""
        parts = [self._unscaled.parts(one[: self._unscaled.unknowns], self.sizes) for one in x]
        q, values = (np.array([part[name] for part in parts]) for name in ("q", "values"))
        differences = wrap_difference(q[:, None] - self.bases, self.arm.periodic)
        which = np.linalg.norm(differences, axis=2).argmin(axis=1)
        self_motion = np.einsum("pjr,pj->pr", self._base_frames[1][which], differences[np.arange(len(q)), which])
        genes, front = [((which + 0.5) / len(self.bases))[:, None], self_motion], np.zeros_like(q)
        motors = np.array([part["motors"] for part in parts])
        if isinstance(self.actuation, DistributedActuation):
            front = np.array([part["front"] for part in parts])
            genes.append(np.clip(slider_shares(self.actuation, front), 0.0, 1.0))
        dq = (self.actuation.ratios(q, front)[:, None] * motors).sum(axis=2)
        best = self.maxima(q, front)
        speeds, fastest = (each[:, self.moving] for each in (values, best.values))
        pace = np.clip(speeds / np.where(fastest > 0, fastest, 1.0), 0.0, 1.0)
        along = (dq - pace[..., None] * best.dq) / best.span[:, None, None]
        joint_shares = np.einsum("pjr,pkj->pkr", best.free, along)
        genes += [pace, joint_shares.reshape(len(q), math.prod(joint_shares.shape[1:]))]
        clipped: Genes = np.clip(np.concatenate(genes, axis=1), self.xl, self.xu)
        return clipped

    @cached_property
    def _unscaled(self) -> DirectionalProgram:
        return DirectionalProgram(
            arm=self.arm,
            actuation=self.actuation,
            quantities=self.quantities,
            power=self.power,
        )

    @cached_property
    def _gene_counts(self) -> dict[str, int]:
        """Number of genes of each kind, in order."""
        free, speeds = self.stationary.redundancy, int(self.moving.sum())
        slides = self.arm.dof * isinstance(self.actuation, DistributedActuation)
        return {"place": 1, "self_motion": free, "front": slides, "pace": speeds, "joint_shares": speeds * free}

    def _parts(self, genes: Genes) -> dict[str, np.ndarray]:
        """Return the genes by name."""
        return {name: genes[:, place] for name, place in consecutive_slices(self._gene_counts).items()}

    def _evaluate(self, X: Genes, out: dict[str, object], *args: object, **kwargs: object) -> None:
        at = self.configuration(X)
        own, limits, causes = evaluate_motions(self.functions, self._motions(at.q), interruptible=False)
        unbounded = np.isinf(at.values).any(axis=1)
        out["cause"] = np.where(unbounded, "a force that loads no joint has no bound", causes)
        failed = (~np.isfinite(own).all(axis=1) | unbounded)[:, None]
        invalid = failed | ~np.isfinite(at.power).all(axis=1, keepdims=True)
        power = at.power.max(axis=1, keepdims=True, initial=0.0)[:, : int(self.power)]
        G = np.concatenate([at.excess, limits - LIMIT_TOLERANCE], axis=1)
        out["F"] = np.where(invalid, 0.0, np.concatenate([-at.values, power, own], axis=1))
        out["G"] = np.where(np.isnan(G), 1.0, np.where(failed, np.maximum(G, 1e-3), G))
