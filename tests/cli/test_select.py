from __future__ import annotations

from paretoik.api.load_front import load_front
from tests.cli.commands import strict


def test_select_as_json_gives_id_objectives_and_reason(paretoik, finished):
    front = load_front(finished)
    said = strict(paretoik("select", finished, "--weights", "kinetic_energy=1", "--json").out)
    assert said["id"] == front.ids[0]
    assert said["objectives"] == dict(zip(front.names, front.objectives[0].tolist(), strict=True))
    assert said["reason"].startswith(f"Of {len(front)} points point {front.ids[0]} has the least weighted sum")


def test_select_draws_a_picture_where_told(paretoik, finished, tmp_path):
    assert paretoik("select", finished, "--weights", "torque_norm=1", "--picture", tmp_path / "choice.png").code == 0
    assert (tmp_path / "choice.png").read_bytes().startswith(b"\x89PNG")
