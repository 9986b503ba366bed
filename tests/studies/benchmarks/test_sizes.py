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


def test_a_library_is_counted_by_package_and_long_parts_are_named(tmp_path):
    (tmp_path / "part").mkdir()
    (tmp_path / "__init__.pyi").write_text("from .part import a as a, b as b\n")
    (tmp_path / "__init__.py").write_text("")
    (tmp_path / "part" / "long.py").write_text("def f():\n    '''d'''\n" + "    x = 1\n" * 61 + "y = 2\n" * 300)
    sizes = measure(tmp_path)
    assert sizes.lines == {"part": 363, "(modules)": 0}
    assert sizes.files == {"part/long.py": 363}
    assert sizes.functions == {"part/long.py:f": 62}
    assert sizes.public == 2
    rows = {row.row: row for row in tabulate(sizes, sizes) if row.table == "what is long"}
    assert rows["files above 300 lines"].note == "goal at most 0; part/long.py 363"
    assert rows["public names"].reference == 2
