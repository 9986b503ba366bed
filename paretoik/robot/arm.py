"""The arm: a serial chain of revolute, continuous and prismatic joints, as data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from paretoik.arrays import Matrix3, Vector3
from paretoik.errors import InvalidInput
from paretoik.robot.body import Body, combine_bodies, transform_body
from paretoik.robot.pose import ArrayLike, Pose

JointType = Literal["revolute", "continuous", "prismatic"]
JOINT_TYPES: tuple[JointType, ...] = ("revolute", "continuous", "prismatic")
EARTH = (0.0, 0.0, -9.81)


@dataclass(frozen=True, kw_only=True)
class Frame:
    """A named place on the arm: a pose in the frame of link ``link`` (−1: the base)."""

    link: int
    pose: Pose


@dataclass(frozen=True, kw_only=True, eq=False)
class Arm:
    """A serial arm, frozen; make one with ``planar``, ``from_dh`` or ``from_urdf``.

    Joint i moves link i about (or along) the z axis of its own frame; ``placements[i]`` is that frame in the one before
    (the base for the first) at q = 0. Units are SI and radians. Limits are (lower, upper) rows, infinite where there is
    none. ``notices`` say what a file had that the arm has not, such as frozen joints. Every way to make or change
    an arm raises InvalidInput for what no arm can be.
    """

    name: str
    joint_names: tuple[str, ...]
    joint_types: tuple[JointType, ...]
    placements: tuple[Pose, ...]
    bodies: tuple[Body, ...]
    tool: Pose
    base: Pose
    gravity: Vector3
    position_limits: Float[np.ndarray, "dof 2"]
    velocity_limits: Float[np.ndarray, " dof"]
    torque_limits: Float[np.ndarray, " dof"]
    is_planar: bool = False
    frames: Mapping[str, Frame] = field(default_factory=dict)
    source: Path | None = None
    notices: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check what every constructor relies on."""
        if not self.joint_names:
            raise InvalidInput(f"arm {self.name}: wants at least one moving joint, has none")
        if len(set(self.joint_names)) != self.dof:
            raise InvalidInput(f"arm {self.name}: joint names must differ, got {', '.join(self.joint_names)}")
        for kind in self.joint_types:
            if kind not in JOINT_TYPES:
                raise InvalidInput(f"arm {self.name}: joint type must be one of {', '.join(JOINT_TYPES)}, got {kind!r}")
        for name, (low, high) in zip(self.joint_names, np.reshape(self.position_limits, (-1, 2)), strict=False):
            if not low <= high:
                raise InvalidInput(
                    f"arm {self.name}, {name}: position limits lower ≤ upper wanted, got {low:g}, {high:g}"
                )
        for array in (self.gravity, self.position_limits, self.velocity_limits, self.torque_limits):
            array.setflags(write=False)

    @property
    def dof(self) -> int:
        """Number of joints that move."""
        return len(self.joint_names)

    @property
    def periodic(self) -> np.ndarray:
        """Whether each joint turns about an axis, so that its angle matters modulo 2π; shape (dof,)."""
        return np.array([kind != "prismatic" for kind in self.joint_types])

    def __repr__(self) -> str:
        return f"Arm({self.name!r}, {self.dof} joints: {', '.join(self.joint_names)})"

    @classmethod
    def planar(
        cls,
        *,
        lengths: ArrayLike,
        masses: ArrayLike | None = None,
        centers: ArrayLike | None = None,
        inertias: ArrayLike | None = None,
        position_limits: object = None,
        velocity_limits: object = None,
        torque_limits: object = None,
        name: str = "planar arm",
    ) -> Arm:
        """Return an arm of revolute joints in the x-y plane, angles relative, without gravity.

        ``lengths`` [m], ``masses`` [kg], ``centers`` of gravity from the proximal joint [m] and barycentric
        ``inertias`` about z [kg m²] have one value a link; without masses the links are massless (kinematics only).
        Limits as in ``from_dh``. Source of the convention: Tringali & Cocuzza 2020, section 3.2.

        Raises InvalidInput where a length is not positive or the lists differ in length.

        >>> Arm.planar(lengths=[1.0, 1.0, 1.0]).dof
        3
        """
        length = _numbers("lengths", lengths, None, positive=True)
        count = len(length)
        mass, center, inertia = (
            np.zeros(count) if values is None else _numbers(what, values, count, positive=False)
            for what, values in (("masses", masses), ("centers", centers), ("inertias", inertias))
        )
        if masses is not None and (np.any(mass < 0) or np.any(inertia < 0)):
            raise InvalidInput("planar arm: masses and inertias must not be negative")
        before = np.concatenate([[0.0], length[:-1]])
        return cls(
            name=name,
            joint_names=tuple(f"joint{i + 1}" for i in range(count)),
            joint_types=_revolute(count),
            placements=tuple(Pose(np.array([x, 0.0, 0.0])) for x in before),
            bodies=tuple(
                Body(mass=float(m), center=np.array([c, 0.0, 0.0]), inertia=np.diag([0.0, j, j]))
                for m, c, j in zip(mass, center, inertia, strict=True)
            ),
            tool=Pose(np.array([length[-1], 0.0, 0.0])),
            base=Pose(np.zeros(3)),
            gravity=np.zeros(3),
            position_limits=limit_pairs("position_limits", position_limits, count),
            velocity_limits=magnitudes("velocity_limits", velocity_limits, count),
            torque_limits=magnitudes("torque_limits", torque_limits, count),
            is_planar=True,
        )

    @classmethod
    def from_dh(
        cls,
        *,
        a: ArrayLike,
        alpha: ArrayLike,
        d: ArrayLike,
        theta: ArrayLike,
        convention: Literal["modified", "standard"],
        types: Sequence[JointType] | None = None,
        masses: ArrayLike | None = None,
        centers: object = None,
        inertias: object = None,
        joint_names: Sequence[str] | None = None,
        position_limits: object = None,
        velocity_limits: object = None,
        torque_limits: object = None,
        name: str = "DH arm",
    ) -> Arm:
        """Return an arm from a table of Denavit–Hartenberg parameters, one value a joint.

        ``a``, ``d`` in m, ``alpha``, ``theta`` in rad; ``theta`` (``d`` for a prismatic joint) is the offset that the
        joint coordinate is added to. "modified" (Craig): row i holds a and alpha of link i − 1, and link frames sit on
        their own joint. "standard": link frames sit on the next joint; the last one is the tool. ``centers`` (dof, 3)
        and barycentric ``inertias`` (dof, 3, 3) are given in the link frames of the convention. ``position_limits``:
        None, or as (lower, upper), or a symmetric number or array. Gravity is (0, 0, −9.81).

        Raises InvalidInput where the table is not rectangular, or an entry is not finite.
        """
        if convention not in ("modified", "standard"):
            raise InvalidInput(f"convention must be 'modified' or 'standard', got {convention!r}")
        count = len(np.atleast_1d(a))
        table = {k: _numbers(k, v, count) for k, v in (("a", a), ("alpha", alpha), ("d", d), ("theta", theta))}
        kinds = _revolute(count) if types is None else tuple(types)
        if len(kinds) != count:
            raise InvalidInput(f"types wants {count} values, one a joint, got {len(kinds)}")
        shifts = [_transform(0.0, 0.0, table["d"][i], table["theta"][i]) for i in range(count)]
        bends = [_transform(table["a"][i], table["alpha"][i], 0.0, 0.0) for i in range(count)]
        bodies = _bodies(masses, centers, inertias, count)
        # The joint moves along z, so its constant offset d and theta commute with it and may stand on either side.
        if convention == "modified":
            placements, tool = [bends[i] @ shifts[i] for i in range(count)], Pose(np.zeros(3))
        else:
            placements = [(bends[i - 1] if i else Pose(np.zeros(3))) @ shifts[i] for i in range(count)]
            tool, bodies = bends[-1], tuple(transform_body(body, bends[i]) for i, body in enumerate(bodies))
        names = tuple(joint_names) if joint_names is not None else tuple(f"joint{i + 1}" for i in range(count))
        if len(names) != count:
            raise InvalidInput(f"joint_names wants {count} names, got {len(names)}")
        return cls(
            name=name,
            joint_names=names,
            joint_types=kinds,
            placements=tuple(placements),
            bodies=bodies,
            tool=tool,
            base=Pose(np.zeros(3)),
            gravity=np.array(EARTH),
            position_limits=limit_pairs("position_limits", position_limits, count),
            velocity_limits=magnitudes("velocity_limits", velocity_limits, count),
            torque_limits=magnitudes("torque_limits", torque_limits, count),
        )

    @classmethod
    def from_urdf(
        cls,
        file: str | Path,
        *,
        base: str | None = None,
        tip: str | None = None,
        fixed: Mapping[str, float] | None = None,
        zero_limits: Literal["unlimited"] | None = None,
    ) -> Arm:
        """Return the chain from link ``base`` (default: the root) to link ``tip`` (default: the only leaf) of a URDF.

        Fixed joints and massless fixed links are merged; joints off the chain are frozen at 0, and with ``fixed``,
        named joints at given values. The file is validated first, and its meshes are never opened. A velocity or effort
        limit of zero is refused unless ``zero_limits="unlimited"`` says that it means none. Gravity is (0, 0, −9.81).

        Raises InvalidRobot listing every fault, InvalidInput for unknown names or zero limits.
        """
        from paretoik.robot.urdf import from_urdf  # here, because reading a URDF builds on this class

        return from_urdf(Path(file), base=base, tip=tip, fixed=fixed, zero_limits=zero_limits)

    def with_tool(
        self, pose: Pose, *, mass: float = 0.0, center: object = (0.0, 0.0, 0.0), inertia: object = None
    ) -> Arm:
        """Return the arm with a tool whose working point is ``pose`` in the present tool frame.

        ``mass`` [kg], ``center`` (3,) [m] and barycentric ``inertia`` (3, 3) [kg m²] are given in the present tool
        frame.
        """
        return replace(self.with_payload(mass, center=center, inertia=inertia), tool=self.tool @ pose)

    def with_payload(self, mass: float, *, center: object = (0.0, 0.0, 0.0), inertia: object = None) -> Arm:
        """Return the arm carrying a body in the tool frame.

        ``mass`` [kg], ``center`` (3,) [m], barycentric ``inertia`` (3, 3) [kg m²], None for a point mass.
        """
        payload = Body.from_values("payload", mass, center, inertia)
        last = combine_bodies(self.bodies[-1], transform_body(payload, self.tool))
        return replace(self, bodies=(*self.bodies[:-1], last))

    def mounted(self, *, base: Pose | None = None, gravity: object = None) -> Arm:
        """Return the arm standing at ``base`` in the world, under ``gravity`` (3,) [m/s²] given in world axes."""
        field_ = self.gravity if gravity is None else np.asarray(gravity, dtype=float)
        if field_.shape != (3,) or not np.all(np.isfinite(field_)):
            raise InvalidInput(f"gravity wants three finite numbers, got {gravity!r}")
        return replace(self, base=self.base if base is None else base, gravity=field_.copy())

    def fixed(self, positions: Mapping[str, float] | None = None, /, **joints: float) -> Arm:
        """Return the arm with joints frozen at values [rad or m], by name: ``arm.fixed(joint2=0.3)``.

        Raises InvalidInput for an unknown joint, a value that is not finite, or when no joint would be left.
        """
        arm = self
        for joint, value in {**(positions or {}), **joints}.items():
            arm = arm._without(joint, value)
        return arm

    def _without(self, joint: str, value: float) -> Arm:
        if joint not in self.joint_names:
            raise InvalidInput(f"joint {joint!r} is not on {self.name}; its joints: {', '.join(self.joint_names)}")
        if not np.isfinite(value):
            raise InvalidInput(f"joint {joint}: wants a finite value to be fixed at, got {value}")
        if self.dof == 1:
            raise InvalidInput(f"joint {joint}: the last moving joint of {self.name} cannot be fixed")
        i = self.joint_names.index(joint)
        held = self.placements[i] @ joint_motion(self.joint_types[i], float(value))
        placements, bodies, tool = list(self.placements), list(self.bodies), self.tool
        if i + 1 < self.dof:
            placements[i + 1] = held @ placements[i + 1]
        else:
            tool = held @ tool
        if i > 0:
            bodies[i - 1] = combine_bodies(bodies[i - 1], transform_body(bodies[i], held))
        del placements[i], bodies[i]
        keep = np.arange(self.dof) != i
        return replace(
            self,
            joint_names=tuple(np.array(self.joint_names, dtype=object)[keep]),
            joint_types=tuple(np.array(self.joint_types, dtype=object)[keep]),
            placements=tuple(placements),
            bodies=tuple(bodies),
            tool=tool,
            position_limits=self.position_limits[keep],
            velocity_limits=self.velocity_limits[keep],
            torque_limits=self.torque_limits[keep],
            frames={name: _reattached(frame, i, held) for name, frame in self.frames.items()},
        )

    def frame(self, name: str) -> Frame:
        """Return the frame called ``name``: "tool", "base", a link named after its joint, or a link of the URDF.

        Raises InvalidInput listing the valid names.
        """
        origin = Pose(np.zeros(3))
        own = {joint: Frame(link=i, pose=origin) for i, joint in enumerate(self.joint_names)}
        known = {
            "tool": Frame(link=self.dof - 1, pose=self.tool),
            "base": Frame(link=-1, pose=origin),
            **own,
            **{link: frame for link, frame in self.frames.items() if link not in ("tool", "base")},
        }
        if name not in known:
            raise InvalidInput(f"frame {name!r} is not on {self.name}; its frames: {', '.join(known)}")
        return known[name]


def joint_motion(kind: JointType, value: float) -> Pose:
    """Return the pose that a joint at ``value`` [rad or m] adds after its placement."""
    if kind == "prismatic":
        return Pose(np.array([0.0, 0.0, value]))
    return Pose(np.zeros(3), np.array([np.cos(value / 2), 0.0, 0.0, np.sin(value / 2)]))


def limit_pairs(what: str, given: object, count: int) -> Float[np.ndarray, "dof 2"]:
    """Return limits as rows (lower, upper), (count, 2); None is unlimited, a tuple (lower, upper), else symmetric."""
    if given is None:
        return np.tile([-np.inf, np.inf], (count, 1))
    try:
        lower, upper = given if isinstance(given, tuple) and len(given) == 2 else (-np.asarray(given, float), given)
        rows = np.stack([np.broadcast_to(np.asarray(side, float), (count,)) for side in (lower, upper)], axis=-1)
    except ValueError:
        raise InvalidInput(f"{what} wants one value or {count}, one a joint, got {given!r}") from None
    if np.isnan(rows).any() or np.any(rows[:, 0] > rows[:, 1]):
        bad = int(np.argmax(np.isnan(rows).any(axis=1) | (rows[:, 0] > rows[:, 1])))
        raise InvalidInput(f"{what} of joint {bad + 1}: wants lower ≤ upper, got {rows[bad, 0]} and {rows[bad, 1]}")
    return rows


def magnitudes(what: str, given: object, count: int) -> Float[np.ndarray, " dof"]:
    """Return symmetric limits (count,); None means unlimited."""
    try:
        values = np.broadcast_to(np.asarray(np.inf if given is None else given, float), (count,)).copy()
    except ValueError:
        raise InvalidInput(f"{what} wants one value or {count}, one a joint, got {given!r}") from None
    if not np.all(values > 0):
        raise InvalidInput(f"{what} wants positive values, got {given!r}")
    return values


def _revolute(count: int) -> tuple[JointType, ...]:
    kinds: list[JointType] = ["revolute"] * count
    return tuple(kinds)


def _numbers(what: str, values: object, count: int | None, *, positive: bool = False) -> np.ndarray:
    array = np.asarray(values, dtype=float)
    if array.ndim != 1 or (count is not None and len(array) != count) or not np.all(np.isfinite(array)):
        wish = "a list of finite numbers" if count is None else f"{count} finite numbers, one a joint"
        raise InvalidInput(f"{what} wants {wish}, got {values!r}")
    if len(array) == 0:
        raise InvalidInput(f"{what} wants at least one moving joint's value, got none")
    if positive and np.any(array <= 0):
        raise InvalidInput(f"{what} wants positive numbers, got {values!r}")
    return array


def _bodies(masses: object, centers: object, inertias: object, count: int) -> tuple[Body, ...]:
    mass = np.zeros(count) if masses is None else _numbers("masses", masses, count)
    center = np.zeros((count, 3)) if centers is None else np.asarray(centers, float)
    inertia = np.zeros((count, 3, 3)) if inertias is None else np.asarray(inertias, float)
    if center.shape != (count, 3) or inertia.shape != (count, 3, 3):
        raise InvalidInput(
            f"centers and inertias want shapes {(count, 3)} and {(count, 3, 3)}, got {center.shape} and {inertia.shape}"
        )
    return tuple(Body.from_values(f"link {i + 1}", mass[i], center[i], inertia[i]) for i in range(count))


def _transform(a: float, alpha: float, d: float, theta: float) -> Pose:
    rotation: Matrix3 = np.array(
        [
            [np.cos(theta), -np.sin(theta), 0.0],
            [np.cos(alpha) * np.sin(theta), np.cos(alpha) * np.cos(theta), -np.sin(alpha)],
            [np.sin(alpha) * np.sin(theta), np.sin(alpha) * np.cos(theta), np.cos(alpha)],
        ]
    )
    return Pose.from_matrix(rotation, np.array([a, -np.sin(alpha) * d, np.cos(alpha) * d]))


def _reattached(frame: Frame, joint: int, held: Pose) -> Frame:
    if frame.link < joint:
        return frame
    return Frame(link=frame.link - 1, pose=held @ frame.pose if frame.link == joint else frame.pose)
