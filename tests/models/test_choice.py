"""Which of several figures of one quantity is to design with."""

from __future__ import annotations

from sbafab.actuators import load_design
from sbafab.models.prediction import predict


def test_the_work_of_the_elastic_balloon_stands_before_its_upper_bound() -> None:
    """At 10 kPa both are given; p v with Eq. 4 is three times as much. At 100 kPa it is alone."""
    work = {
        (figure.name, figure.model.name): figure.other
        for figure in predict(load_design("1dof-5mm", ["models.calibration=none"])).figures
        if figure.name.startswith("pneumatic input work")
    }
    assert work == {
        ("pneumatic input work at 10 kPa, free", "elastic balloon"): False,
        ("pneumatic input work at 10 kPa", "p v with Eq. 4"): True,
        ("pneumatic input work at 100 kPa", "p v with Eq. 4"): False,
    }
