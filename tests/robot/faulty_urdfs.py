"""A robot of two links and a joint as text, with places to put faults."""

from __future__ import annotations

INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
BODY = f'<inertial><mass value="1"/>{INERTIA}</inertial>'
LIMIT = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'
ENDS = '<parent link="a"/><child link="b"/>'
JOINT = f'<joint name="j" type="revolute">{ENDS}{LIMIT}</joint>'
HEAD = '<?xml version="1.0"?>\n<robot name="r">\n'
TAIL = "\n</robot>"


def robot(body=BODY, joint=JOINT, more=""):
    """Return a robot whose link b is on line 4 and whose joint is on line 5."""
    return f'{HEAD}<link name="a"/>\n<link name="b">{body}</link>\n{joint}\n{more}{TAIL}'


def massed(mass, inertia=INERTIA):
    return robot(f"<inertial>{mass}{inertia}</inertial>")


def moments(xx, yy, zz, xy=0):
    return massed('<mass value="1"/>', f'<inertia ixx="{xx}" ixy="{xy}" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/>')


def jointed(inside, kind="revolute"):
    return robot(joint=f'<joint name="j" type="{kind}">{inside}</joint>')


def limited(limit, kind="revolute"):
    return jointed(ENDS + limit, kind)
