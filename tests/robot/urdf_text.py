"""Parts of a URDF as text, for tests that write small robots."""

from __future__ import annotations

BODY = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="4"/>'


def link(name: str, body: str = BODY) -> str:
    return f'<link name="{name}">{body}</link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = LIMIT) -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def chain_of_three(middle: str = "revolute", inside: str = LIMIT, last: str = BODY) -> list[str]:
    """Return links a-b-c-d with joints j1, j2 (of a kind) and j3."""
    links = [link("a"), link("b"), link("c"), link("d", last)]
    return [*links, joint("j1", "a", "b"), joint("j2", "b", "c", middle, inside), joint("j3", "c", "d")]
