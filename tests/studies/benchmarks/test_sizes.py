"""Lines and long parts that are counted."""

from __future__ import annotations

from studies.benchmarks.sizes import measure, tabulate


def test_a_library_is_counted_by_package_and_what_has_a_budget_is_named(tmp_path):
    (tmp_path / "part").mkdir()
    (tmp_path / "__init__.pyi").write_text("from .part import a as a, b as b\n")
    (tmp_path / "__init__.py").write_text("")
    many = ", ".join(f"x{i}" for i in range(11))
    long = "def f():\n    '''d'''\n" + "    x = 1\n" * 61
    functions = f"{long}def g({many}): _once()\ndef a({many}): ...\ndef _once(): ...\n"
    (tmp_path / "part" / "long.py").write_text("from paretoik.part.other import x\n" + functions + "y = 2\n" * 600)
    (tmp_path / "part" / "other.py").write_text("def h():\n    from paretoik.part import long\n")
    sizes = measure(tmp_path)
    assert sizes.lines == {"part": 669, "(modules)": 0}
    assert sizes.functions == {"part/long.py:f": 62}
    assert sizes.parameters == {"part/long.py:g": 11}
    assert sizes.used_once == ["part/long.py:_once"]
    assert sizes.single_importer == ["part/long.py", "part/other.py"]
    assert sizes.circles == [("part/long.py", "part/other.py")]
    assert sizes.public == 2
    rows = {row.row: row for row in tabulate(sizes, sizes) if row.table == "budgets"}
    assert rows["files above 600 lines"].note == "goal at most 0; part/long.py"
    assert rows["files below 40 lines"].note == "goal at most 0; part/other.py"
    assert rows["circles of imports"].ours == 1
    assert rows["public names"].reference == 2
