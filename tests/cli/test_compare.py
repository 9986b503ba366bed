from __future__ import annotations

import paretoik as pk
from tests.cli.commands import strict


def test_compare_prints_tables_draws_and_keeps_the_merged_front(paretoik, finished, tmp_path):
    picture, merged = tmp_path / "fronts.png", tmp_path / "merged"
    words = ("compare", finished, finished, "--labels", "a,b", "--picture", picture, "--merge", merged)
    ended = paretoik(*words)
    assert ended.code == 0
    assert "hypervolume" in ended.out
    assert f"{merged}: {len(pk.Front.load(finished))} points" in ended.out
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert len(pk.Front.load(merged)) == len(pk.Front.load(finished))
    assert paretoik(*words).code == 2  # a run is there already
    assert paretoik(*words, "--overwrite").code == 0


def test_compare_as_json_holds_the_numbers(paretoik, finished):
    said = strict(paretoik("compare", finished, finished, "--json").out)
    assert said["hypervolume"] == [1.0, 1.0]
    assert said["coverage"] == [[1.0, 1.0], [1.0, 1.0]]
    assert said["differences"] == {}
    assert "merged" not in said
    front = pk.Front.load(finished)
    assert sorted(said["attainment"]["all"]["median"]) == sorted(front.objectives.tolist())
    assert list(said["attainment"]["labels"]) == [finished.name]  # one label, as of two runs of one method
