"""Lines, constants and long parts that are counted, and lines that are not."""

from __future__ import annotations

import ast

from studies.benchmarks.sizes import code_lines, measure, numeric_constants, tabulate

MODULE = '''"""A docstring
of two lines."""

# a comment
LIMIT = 3  # counts
NAMES = ("a", "b")
LOWER, UPPER = range(2)
limit = 4


def act(x,
        y):
    """A docstring."""
    if x:

        return [
            x,
        ]
    return y
'''


def test_code_is_neither_docstring_nor_comment_nor_blank():
    assert code_lines(ast.parse(MODULE)) == {5, 6, 7, 8, 11, 12, 14, 16, 17, 18, 19}


def test_constants_are_names_in_capitals_for_numbers():
    assert list(numeric_constants(ast.parse(MODULE))) == ["LIMIT"]


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
