"""Rows of the paper's figures beside the predictions, as values and as Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from sbafab.actuators import build, load_design
from sbafab.laminate.lay_up import FoldedHeight
from sbafab.models import paper
from sbafab.models.balloons import balloons_of
from sbafab.models.closed_forms import eq_4, eqs_1_to_3
from sbafab.models.elastic import air_time, pose_bent_by, time_to_fill
from sbafab.models.figures import Factors, Prediction, PredictionRequest
from sbafab.models.formulas import modulus
from sbafab.models.pneumatics import AIR, Line, seconds
from sbafab.models.prediction import predict
from sbafab.models.quantity import ModelId, chamber_count, share_of_stroke
from sbafab.models.rippled import free_shapes
from sbafab.models.stack import Stack, stack
from sbafab.pressing.schedule import schedule

NONE = "none"
"""The model's name for a figure that no model predicts."""


class Row(NamedTuple):
    """A figure of the paper; ``predicted`` is None if no model predicts it."""

    figure: str
    measured: paper.Measured
    predicted: float | None
    model: str
    why: str

    @property
    def paper(self) -> float | None:
        """The paper's value; None if it is a word."""
        return self.measured.value if self.measured.unit else None

    @property
    def error(self) -> float | None:
        """The paper's error; None if it does not state one."""
        return self.measured.error or None


def exact(value: float, unit: str, where: str) -> paper.Measured:
    return paper.Measured(value, 0.0, unit, where)


def table(title: str, rows: Sequence[Row]) -> Iterator[str]:
    yield f"## {title}\n"
    yield "| figure | paper | | predicted | residual | model | why they part |"
    yield "|---|---|---|---|---|---|---|"
    for row in rows:
        measured = str(row.measured) if row.measured.unit else ""
        yield (
            f"| {row.figure} | {measured} | {row.measured.where} | {_predicted(row)} | "
            f"{_residual(row)} | {row.model} | {row.why} |"
        )
    yield ""


def _predicted(row: Row) -> str:
    return "not" if row.predicted is None else f"{row.predicted:.4g} {row.measured.unit}"


def _residual(row: Row) -> str:
    if row.predicted is None:
        return ""
    apart = row.predicted - row.measured.value
    share = f"{apart:+.3g}, {apart / row.measured.value:+.1%}"
    errors = f" ({abs(apart) / row.measured.error:.1f} errors)" if row.measured.error else ""
    return f"{share}{errors}"


def predicted(
    template: str, factors: Factors | None = None, pressures: tuple[float, ...] = (10.0, 100.0)
) -> Prediction:
    """Return the prediction of a template."""
    return predict(
        load_design(template), PredictionRequest(pressures, calibration=factors or Factors())
    )


# Manufacture, sizes, strokes by the paper's own models, other simulations.


def process() -> Iterator[Row]:
    design = load_design("3dof-15mm").completed()
    plan = schedule(build(design), design)
    assert plan.estimated_build_minutes is not None, "the paper states minutes for its film"
    yield Row(
        "time to build, 3-DoF",
        exact(1.75, "h", "Sec. 2"),
        plan.estimated_build_minutes / 60,
        "press schedule",
        f"{plan.total_press_minutes:g} min in the press are the paper's; the other 60 are "
        "handling, which we set from this very figure",
    )
    yield Row(
        "success rate",
        exact(90, "%", "Sec. 6"),
        None,
        NONE,
        "leaks and over-melting are not modelled",
    )
    yield Row(
        "burst pressure",
        paper.BURST,
        None,
        NONE,
        "the strength of films and bonds is not known; taken as the end of the pressure range",
    )


def sizes(three: Prediction) -> Iterator[Row]:
    geometry = "plain geometry"
    yield Row(
        "circle round the 3-DoF",
        exact(15, "mm", "Sec. 2"),
        three.value("outline_diameter"),
        geometry,
        "one bond width between lumen and chamber, one outside the chamber",
    )
    radial = predicted("radial-15mm")
    yield Row(
        "radial, deflated",
        paper.RADIAL_FLAT,
        radial.value("deflated_diameter"),
        "tube and films",
        "the paper rounds: it adds 0.330",
    )
    yield Row(
        "radial, inflated (about)",
        paper.RADIAL_FULL,
        radial.value("inflated_diameter"),
        "cylinder of unstretched film",
        "a pocket 10 wide becomes a cylinder of 6.366",
    )
    yield Row(
        "radial, inflated (about)",
        paper.RADIAL_FULL,
        max(radial.relations[-1].lines[0].y),
        "lens of two arcs, largest volume",
        "the round ends are full a little before the straight run is",
    )
    yield Row(
        "inlet opens to the tube",
        exact(1.016, "mm", "Sec. 2"),
        three.value("largest_tube"),
        "half the perimeter",
        "a strip of 1.95 is cut 1.65 at its narrowest; with its PTFE the tube needs 1.635",
    )
    tall = "sum of the films"
    yield Row(
        "3-DoF of 15 balloons, deflated",
        paper.FLAT_HEIGHT,
        three.value("folded_height"),
        tall,
        "films that melt flow in the press; the paper gives no factor, and none is applied here",
    )
    chords = "three lobes as chords of a circle"
    yield Row(
        "channel that the folded 3-DoF passes",
        paper.FOLDED,
        three.value("folded_diameter"),
        f"{chords}, nominal thickness",
        "the pressed lobes are thinner than the films' sum",
    )
    pressed = predicted("3dof-15mm", Factors(press_factor()))
    yield Row(
        "the same",
        paper.FOLDED,
        pressed.value("folded_diameter"),
        f"{chords}, the paper's 0.95",
        "the paper's figure lies between the two; likely the lobes do not fold as tight as bars",
    )


def strokes() -> Iterator[Row]:
    fluids = {"air": "air is squeezed as pressure rises", "water": "strain begins"}
    for fluid, volume, error in paper.VALID:
        yield Row(
            f"largest error of Eq. 4 to {volume:g} ul, d = 10, {fluid}",
            error,
            None,
            "Eq. 4",
            f"an error, not a stroke; Eq. 4 gives {float(eq_4(5.0).stroke(volume)):.3f} mm there, "
            f"Eqs. 1-3 {float(eqs_1_to_3(5.0).stroke(volume)):.3f}; {fluids[fluid]}",
        )
    most = eqs_1_to_3(2.5)
    yield Row(
        "end of the geometric regime, d = 5",
        exact(0.95, "kPa", "Sec. 4.2"),
        None,
        NONE,
        "the geometric model knows no pressure; `sbafab simulate` does",
    )
    yield Row(
        "stroke of one balloon at full actuation",
        exact(1.2, "mm", "Sec. 4.6"),
        most.largest_stroke / 2,
        "Eqs. 1-3, one half at its largest volume, h as the paper counts it",
        "an upper end that no stated pressure belongs to; 15 of them are 19.9 mm, the paper's "
        '"almost 2 cm" (Sec. 4.2)',
    )
    yield Row(
        "the same",
        exact(1.2, "mm", "Sec. 4.6"),
        most.largest_stroke,
        "Eqs. 1-3, two halves at their largest volume",
        "as above, with both halves; likely neck rings and wrinkles, which no parabola has, hold a "
        "full balloon back",
    )
    yield Row(
        "height of the 3-DoF of 15 balloons",
        paper.FULL_HEIGHT,
        paper.BALLOONS * most.largest_stroke / 2,
        "Eqs. 1-3, one half each at its largest volume",
        "as above; `predict` takes the paper's 17.5 itself as the reference height, and says so",
    )
    yield Row(
        "volume at which the SOFA model starts, a balloon (about)",
        exact(19, "ul", "Sec. 4.2"),
        most.largest_volume,
        "Eqs. 1-3, largest volume",
        "19.04 is the Mylar balloon's limit, 1.2185 l^3; a parabola of constant length holds less",
    )


def press_factor() -> float:
    """Return pressed over nominal film thickness of the 3-DoF, if its masks kept theirs."""
    folded = _films()
    return (paper.FLAT_HEIGHT.value - folded.solid) / folded.molten


def _films() -> FoldedHeight:
    return Factors().folded(build(load_design("3dof-15mm")))


def simulators() -> Iterator[Row]:
    for figure, value, unit, why in (
        (
            "Abaqus: over-predicts beyond",
            0.95,
            "kPa",
            "an error of another model; docs/simulation.md",
        ),
        ("SOFA: error of stroke as it is", 13.3, "%", "likewise; docs/sofa.md"),
        ("SOFA: largest error after a shift of 0.075 mm", 4.9, "%", "likewise"),
        ("SOFA: speed", 10, "Hz", "depends on machine and mesh; docs/sofa.md"),
    ):
        yield Row(figure, exact(value, unit, "Sec. 4.2, 3.2"), None, NONE, why)


# Energy, force, time, bending, stiffness.


STACK = ModelId.ELASTIC_STACK.words
FORCE_MODELS = (ModelId.WORK_ON_EQ_4, ModelId.WORK_ON_EQS_1_TO_3, ModelId.ELASTIC_STACK)
ENERGY_BALLOONS = 6
"""Balloons of the actuator whose energy was measured (Sec. 7)."""
AVERAGED = (
    "the paper's mean is over two 3-DoF and one 1-DoF actuator (Sec. 7), whose numbers of balloons "
    "it does not give; ours is one 3-DoF of 15"
)
WORKSPACE = (
    "measured with the pneumatic control board, not the water's pump (Sec. 7), at a pressure that "
    "the paper does not give"
)
LENGTHS = (50.0, 100.0, 150.0)
"""Lengths of tube in mm for which the water's time is shown."""


def energy() -> Iterator[Row]:
    prediction = predicted("1dof-10mm", pressures=(1.0, 10.0))
    reasons = {
        1: "low: {least:.3g} ul a balloon at the least would take it, and the model holds "
        "{held:.3g}, so that the figure can be; but here most of the air goes in far below 1 kPa, "
        "as in CalculiX (0.177). No reason known",
        10: "far less: the paper's figure would take {least:.3g} ul a balloon at the least, and "
        "the model holds {held:.3g}: not reconcilable with its pressures and its modulus",
    }
    for pressure, measured in ((1, 0.531), (10, 45.3)):
        least = 1000 * measured / pressure / ENERGY_BALLOONS
        volume = prediction.value("balloon_volume", kpa=pressure)
        yield Row(
            f"energy in at {pressure} kPa, {ENERGY_BALLOONS} balloons, d = 10",
            exact(measured, "mJ", "Sec. 4.1"),
            prediction.value("free_work", kpa=pressure),
            "elastic balloon, integral of p dV",
            reasons[pressure].format(least=least, held=volume),
        )
    for pressure, lost in ((1, 0.055), (10, 4.2)):
        yield Row(
            f"energy lost at {pressure} kPa",
            exact(lost, "mJ", "Sec. 4.1"),
            None,
            NONE,
            "without a calibration the film loses nothing",
        )


FORCE_WHY = {
    ("1-DoF", ModelId.WORK_ON_EQ_4): (
        "low: held flat it touches over most of its pocket, where a parabola touches in a point; "
        "p times the whole pocket is 1.96 N",
        "high: likely film tension, which pulls back once there is a height",
        "high: likely as at 25 %",
    ),
    ("3-DoF", ModelId.WORK_ON_EQ_4): (
        "low: as the 1-DoF; p times three pockets is 5.89 N. 3.3 times the 1-DoF was measured, "
        "where the model says 3",
        "low, where the 1-DoF is high: one factor cannot serve both",
        "near: no reason known why the 1-DoF is not",
    ),
    ("1-DoF", ModelId.WORK_ON_EQS_1_TO_3): (
        "low: touches in a point, and begins 3/4 as steep as Eq. 4",
        "near: likely by two errors that cancel, contact and film tension",
        "high: a parabola goes on to rise where the real balloon is nearly full",
    ),
    ("3-DoF", ModelId.WORK_ON_EQS_1_TO_3): (
        "low: as the 1-DoF",
        "low: as when flat",
        "near: as with Eq. 4",
    ),
    ("1-DoF", ModelId.ELASTIC_STACK): (
        "high: the pockets likely come out smaller than drawn, where molten TPE creeps under the "
        "mask",
        "high: as when flat; a column of six balloons likely also tilts, which a straight one does "
        "not",
        "high: as at 25 %, and the film is likely stiffer than 10 MPa, which bulges less and "
        "touches less",
    ),
    ("3-DoF", ModelId.ELASTIC_STACK): (
        "high: as the 1-DoF, less so; 3.3 times that was measured",
        "high: as when flat",
        "high: as the 1-DoF",
    ),
}


def forces(single: Prediction, three: Prediction) -> Iterator[Row]:
    for name, prediction, measured in (
        ("1-DoF", single, paper.FORCE_1DOF),
        ("3-DoF", three, paper.FORCE_3DOF),
    ):
        for model in FORCE_MODELS:
            whys = FORCE_WHY[name, model]
            for share, value, why in zip(paper.HEIGHTS, measured, whys, strict=True):
                at = f"{name}, 100 kPa, {share_of_stroke(share)}"
                yield Row(at, value, force(prediction, share, model), model.words, why)
    bent_whys = {
        30: "near, with two chambers pressed against a plate square to the tip, which sticks",
        60: "high: the paper does not say which chambers push, nor how the sensor holds the tip",
        90: "with one chamber: two do not bend so far and stay within what films stretch",
    }
    for angle, value in paper.FORCE_BENT:
        chambers = 1 if angle == 90 else 2
        bent = three.value("bent_force", kpa=100, chambers=chambers, angle=angle)
        figure = f"3-DoF, 100 kPa, bent by {angle} deg"
        model_of = f"{STACK}, {chamber_count(chambers)}"
        yield Row(figure, value, bent, model_of, bent_whys[angle])


def force(prediction: Prediction, share: float, model: ModelId) -> float:
    return prediction.value("blocked_force", model, kpa=100, share=share)


def motion(three: Prediction) -> Iterator[Row]:
    whole = stack(load_design("3dof-15mm"))
    yield from _times(three, whole)
    yield from _bends(three, whole)


def _times(three: Prediction, whole: Stack) -> Iterator[Row]:
    yield Row(
        "time to 10 kPa, water, 35 ml/min",
        paper.WATER_TIME,
        three.value("reference_time", flow=paper.WATER_FLOW),
        "Eq. 4 over flow, three chambers of 15 balloons at 17.5 mm",
        "agrees by chance: the stroke is the paper's, and no pressure belongs to it; to 10 kPa in "
        f"the chambers films take in half as much again; {AVERAGED}",
    )
    for length in LENGTHS:
        time, poses = time_to_fill(whole, paper.WATER_FLOW, paper.FULL_KPA, length)
        pressure = poses.pressures[0]
        yield Row(
            "time to 10 kPa, water, 35 ml/min",
            paper.WATER_TIME,
            time,
            f"{STACK} in time, {length:g} mm of tube to each of three chambers",
            f"not a test, for the paper gives no length, and 150 mm is near the one that makes it "
            "come out: of the 10 kPa that the pump's sensor shows the chambers have "
            f"{pressure:.2g}; "
            f"{AVERAGED}",
        )
    full = whole.pose((paper.FULL_KPA,) * whole.chambers).height
    yield Row(
        "height of the 3-DoF of 15 balloons",
        paper.FULL_HEIGHT,
        full,
        f"{STACK}, {paper.FULL_KPA:g} kPa in the chambers",
        f"high: {WORKSPACE}; at {_pressure_at(whole, paper.FULL_HEIGHT.value):.2g} kPa the stack "
        "is as high as measured",
    )
    yield Row(
        "time to 10 kPa, air, 2.5 l/min",
        paper.AIR_TIME,
        float(seconds(three.value("total_volume"), paper.AIR_FLOW, 10)),
        "Eq. 4 over flow, squeezed to 10 kPa",
        "likely valves, tubing and the rise of the pump, which are not in the model; " + AVERAGED,
    )
    yield Row(
        "time to 10 kPa, air, 2.5 l/min",
        paper.AIR_TIME,
        air_time(whole, paper.AIR_FLOW, paper.FULL_KPA, Line(AIR)),
        f"{STACK} in time, 150 mm of tube, 10 kPa in the chambers",
        "likely valve and pump, which take their time to open and to rise; " + AVERAGED,
    )


def _pressure_at(whole: Stack, height: float) -> float:
    """Pressure in kPa in all chambers at which the stack reaches a height in mm."""
    low, high = 0.0, whole.most_pressure
    for _ in range(40):
        middle = (low + high) / 2
        is_low = whole.pose((middle,) * whole.chambers).height < height
        low, high = (middle, high) if is_low else (low, middle)
    return high


def _bends(three: Prediction, whole: Stack) -> Iterator[Row]:
    yield Row(
        "largest bend",
        paper.LARGEST_BEND,
        three.value("reference_bend", chambers=1),
        "constant curvature",
        "upper bound: one chamber is taken to be 17.5 long beside two flat ones",
    )
    full = paper.FULL_KPA
    for count, why in (
        (1, "high: {}; rims that touch on the inner side hold it back, by 6 degrees"),
        (2, "high: {}, nor which chambers"),
    ):
        pose = whole.pose((full,) * count + (0.0,) * (3 - count))
        chambers = "one chamber" if count == 1 else "2 chambers"
        model = f"{STACK}, {full:g} kPa in {chambers}"
        yield Row("largest bend", paper.LARGEST_BEND, pose.bend, model, why.format(WORKSPACE))
    empty = whole.pose((0.0, 0.0, 0.0)).volumes[0]
    for time, angle in paper.BENDING:
        pose_at = pose_bent_by(whole, 1, angle.value)
        assert pose_at is not None
        put_in = float(pose_at.volumes[0] - empty)
        yield Row(
            f"time to {angle.value:g} deg, 35 ml/min",
            exact(time, "s", "Sec. 4.6"),
            put_in / (paper.WATER_FLOW * 1000 / 60),
            f"{STACK}, all the flow into one chamber, which the paper does not say",
            "the paper's time ends at the steady angle and likely holds lag of pump and tube; "
            "with a third of the flow it would be three times as long",
        )


def stiffness(single: Prediction, three: Prediction) -> Iterator[Row]:
    for name, prediction, value in (
        ("1-DoF", single, paper.MODULUS_1DOF),
        ("3-DoF", three, paper.MODULUS_3DOF),
    ):
        tip = prediction.value("shut_stiffness", kpa=10)
        height = prediction.value("free_height", kpa=10)
        second = prediction.value("second_moment")
        yield Row(
            f"cantilever modulus, {name}",
            value,
            modulus(tip, 1.0, height, second),
            f"E = F l^3 / (3 delta I), {STACK} at 10 kPa, chambers shut",
            "low: the paper gives neither pressure, force nor I of its test; at a higher pressure, "
            "or pressed on less far out, it is stiffer",
        )
    power = three.value("power_density", kpa=100)
    yield Row(
        "power densities (Table 2)",
        exact(0, "", "Table 2"),
        None,
        "F v / m",
        "the table's figures are not in the text we have; "
        f"{power:.0f} W/kg for the 3-DoF with air, as the paper takes its speed",
    )


def fuller() -> Iterator[Row]:
    """Strokes of Fig. 7a, which the paper states as Eq. 4 with the largest error up to a volume."""
    design = load_design("1dof-10mm")
    (balloon,) = set(balloons_of(design, build(design), Factors()))
    shapes = free_shapes(balloon, np.geomspace(0.01, 20.0, 60))
    for fluid, volume, error in paper.VALID:
        expected = float(eq_4(paper.VALID_RADIUS).stroke(volume))
        yield Row(
            f"stroke of a balloon of d = 10 with {volume:g} ul of {fluid}, Fig. 7a",
            paper.Measured(round(expected, 3), error.value, "mm", "Sec. 4.2"),
            float(np.interp(volume, shapes.volume, shapes.height)),
            "elastic balloon",
            "Eq. 4 with the largest error that the paper gives up to this volume",
        )


def factors(single: Prediction, three: Prediction) -> Iterator[str]:
    """Lines of the table of factors."""
    folded = _films()
    yield (
        f"| press factor | 3-DoF deflated: {paper.FLAT_HEIGHT.value:g}, less masks of "
        f"{folded.solid:g}, over films of {folded.molten:g} | {press_factor():.3f} |"
    )
    for name, prediction, measured in (
        ("1-DoF", single, paper.FORCE_1DOF),
        ("3-DoF", three, paper.FORCE_3DOF),
    ):
        for model in FORCE_MODELS:
            shares = [
                value.value / force(prediction, share, model)
                for share, value in zip(paper.HEIGHTS, measured, strict=True)
            ]
            shown = ", ".join(f"{share:.2f}" for share in np.array(shares))
            yield (
                f"| measured force over {model.words} | {name} at 100 kPa: flat, 25 %, 75 % "
                f"| {shown} |"
            )
