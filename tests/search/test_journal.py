"""What a journal keeps of a run that was cut short."""

from __future__ import annotations

from pathlib import Path

from sbafab.search.sweep import Journal

ROW = {"outcome": "passes", "reason": "", "figures": {"mass [g]": 0.1}}


def _kept(path: Path, seconds: float = 10.0) -> list[str]:
    journal = Journal(path, seconds)
    keys = [key for key in ("a", "b", "c") if key in journal]
    assert all(row["outcome"] for row in journal.rows(iter(keys)))
    journal.close()
    return keys


def test_rows_come_back_in_the_order_asked_and_none_twice(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    journal = Journal(path, 10.0)
    journal.add("a", ROW)
    journal.add("b", {**ROW, "reason": "second"})
    journal.add("b", {**ROW, "reason": "third"})
    assert [row["reason"] for row in journal.rows(iter("ba"))] == ["second", ""]
    journal.close()
    assert len(path.read_text().splitlines()) == 2
    assert _kept(path) == ["a", "b"]


def test_cut_short_at_any_byte_it_keeps_what_was_whole_and_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    journal = Journal(path, 10.0)
    journal.add("a", ROW)
    first = path.stat().st_size
    journal.add("b", ROW)
    journal.close()
    whole = path.read_bytes()
    # All of a row but its line's end is all of it.
    path.write_bytes(whole[:-1])
    Journal(path, 10.0).close()
    assert _kept(path) == ["a", "b"]
    for size in range(first, len(whole) - 1, 6):
        path.write_bytes(whole[:size])
        assert _kept(path) == ["a"]
        # What is added after the torn line is not lost in it.
        again = Journal(path, 10.0)
        again.add("c", ROW)
        again.close()
        assert path.read_bytes().startswith(whole[:size])
        assert _kept(path) == ["a", "c"]


def test_what_took_too_long_is_tried_again_when_it_is_given_longer(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    journal = Journal(path, 5.0)
    journal.add("a", {"outcome": "too long", "reason": "", "seconds": 5.0})
    journal.close()
    assert _kept(path, 5.0) == ["a"]
    assert _kept(path, 6.0) == []
