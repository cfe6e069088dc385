"""What is said of a table that is not what the design makes."""

from __future__ import annotations

from pathlib import Path

import pytest

from sbafab.folders.differences import file_difference

TABLE = "step,title,minutes\n1,flash,3\n2,bond,12\n"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (TABLE, ""),
        (TABLE.replace("12", "12.00000001"), ""),
        (TABLE + "3,bond,20\n", "it has 3 rows, not 2"),
        ("step,title,minutes\n1,flash,3\n", "it has 1 row, not 2"),
        (TABLE.replace("12", "13"), 'row 2, column minutes is "13", not "12"'),
        (TABLE.replace("flash", "bond"), 'row 1, column title is "bond", not "flash"'),
        (TABLE.replace("bond,12", "bond,12,4"), "row 2 has 4 cells, not 3"),
        (
            TABLE.replace("title", "name"),
            'its columns are "step, name, minutes", not "step, title, minutes"',
        ),
        ("", 'its columns are "", not "step, title, minutes"'),
    ],
)
def test_a_table_s_difference_names_row_and_column(text: str, says: str, tmp_path: Path) -> None:
    found, meant = tmp_path / "found.csv", tmp_path / "meant.csv"
    found.write_text(text)
    meant.write_text(TABLE)
    sentence = file_difference(found, meant, "press.csv")
    assert sentence == (says and f"press.csv is not what design.toml makes: {says}")
