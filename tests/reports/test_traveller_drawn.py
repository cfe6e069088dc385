"""traveller.html of drawn designs: faces, notes, folds and seams as the bench needs them."""

from __future__ import annotations

from typing import Any

from tests.reports.bench_pages import page, words_of


def test_a_coated_film_is_laid_by_its_face(sheet_files: Any) -> None:
    words = words_of(page(sheet_files, "array"))
    # The coating is on the upper face; the cap is laid turned, so that both coatings meet.
    assert "Lay layer 1: TPUNYLON base P01, nylon face down." in words
    assert "Lay layer 3: TPUNYLON cap P03, tpu face down." in words
    assert "face down" not in words_of(page(sheet_files, "1dof-5mm"))


def test_notes_of_a_drawn_design_head_its_lay_up(sheet_files: Any) -> None:
    tree = page(sheet_files, "array")
    lay_up = words_of(tree.get_element_by_id("lay-up").getparent())
    assert "Note: Coated sides face each other: the base's up, the cap's down. Repeat" in lay_up
    assert tree.xpath("//*[@id='trim']") == []
