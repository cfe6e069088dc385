"""A predicted relation as a chart, with what the paper measured."""

from __future__ import annotations

from sbafab.models.figures import Relation
from sbafab.reports.chart import ChartCurve, ChartPoints, Panel, chart_svg


def relation_svg(name: str, relation: Relation) -> str:
    """The chart of a relation of the design called ``name``."""
    curves = [ChartCurve(line.label, line.x, line.y, line.model is None) for line in relation.lines]
    points = [ChartPoints(p.label, p.x, p.y, p.error) for p in relation.points]
    panel = Panel(relation.title, relation.x_label, relation.y_label, curves, points)
    return chart_svg(name, [panel])
