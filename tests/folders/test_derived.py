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
        (TABLE + "3,bond,20\n", "row has 3 entries, not 2"),
        (TABLE.replace("12", "13"), 'row.2.minutes is "13", not "12"'),
        (TABLE.replace("bond,12", "bond,12,4"), "row.2.None is one too many"),
        (TABLE.replace("bond,12", "bond"), 'row.2.minutes is null, not "12"'),
        (TABLE.replace("title", "name"), 'columns.2 is "name", not "title"'),
        ("", "columns has 0 entries, not 3"),
    ],
)
def test_a_table_s_difference_names_row_and_column(text: str, says: str, tmp_path: Path) -> None:
    found, meant = tmp_path / "found.csv", tmp_path / "meant.csv"
    found.write_text(text)
    meant.write_text(TABLE)
    sentence = file_difference(found, meant, "press.csv")
    assert sentence == (says and f"press.csv is not what design.toml makes: {says}")
