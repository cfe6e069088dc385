"""Travellers of templates, read as pages: what the tests of the bench ask."""

from __future__ import annotations

import hashlib
from functools import cache
from typing import Any

from lxml import html as lxml_html

from sbafab.actuators import build, load_design
from sbafab.design.records import Design
from sbafab.laminate.laminate import Laminate
from sbafab.pressing.schedule import schedule
from sbafab.reports.traveller.bench import bench_html
from sbafab.reports.traveller.job import Job, Work
from sbafab.reports.traveller.page import traveller_html
from sbafab.reports.underlay import guides

EARS = 'registration.method="ears"'
SHA = hashlib.sha256(b"design").hexdigest()


@cache
def built(template: str, *assignments: str) -> tuple[Design, Laminate]:
    design = load_design(template, assignments)
    return design, build(design)


def work_of(sheet_files: Any, template: str, *assignments: str) -> Work:
    design, laminate = built(template, *assignments)
    plan = schedule(laminate, design)
    fixture = "sheets/fixture.dxf" if laminate.pins else None
    underlay = "underlay.pdf" if guides(laminate) else None
    job = Job(SHA, "sbafab 1.0.0", fixture=fixture, underlay=underlay)
    sheets = sheet_files(laminate) if sheet_files is not None else ()
    return Work(design, laminate, plan, sheets, job)


def page(sheet_files: Any, template: str, *assignments: str) -> Any:
    """The traveller of a template."""
    work = work_of(sheet_files, template, *assignments)
    return lxml_html.fromstring(traveller_html(work))


def bench(template: str, *assignments: str) -> Any:
    """The page of its bench."""
    work = work_of(None, template, *assignments)
    return lxml_html.fromstring(bench_html(work.design.name, SHA, "sbafab 1.0.0", [work]))


def words_of(node: Any) -> str:
    return " ".join(node.text_content().split())
