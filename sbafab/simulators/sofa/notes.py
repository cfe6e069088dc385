"""What stands at the top of every scene: what it is, what is scaled, fitted or artificial."""

from __future__ import annotations

from sbafab.simulators.coarse.actuator import CoarseActuator
from sbafab.simulators.sofa.parts import scaled_mass
from sbafab.simulators.sofa.shell import Shell

UNITS = "Units: mm, kg, s; so force mN, pressure and modulus kPa, volume ul."
HEIGHTS = "Heights are of mid-surfaces: add the films' thickness to compare with a real one."
LEFT_OUT = "Not in it: gravity, contact of films and balloons."
HALT = """\
runSofa ends with exit code 0 even when the numbers have gone. The run is void if the log shows
Null determinant, Division by zero, NaN or [ERROR], or if the tip stands at 0, higher than its
films reach, or aslant where all chambers are alike."""
MEASURED = "What it gives, at how many steps/s, stands in docs/sofa.md of sbafab."


def shell_note(shell: Shell, dt: float) -> str:
    """Head of scene A."""
    return f"""\
{_head(shell.name, "A: the whole actuator as a shell, core components only.")}
{_mesh(shell)}

Pressure: each chamber has its own SurfacePressureForceField; pressure and pressureLowerBound
(just below it) are what it holds, pressureSpeed how fast it gets there in kPa/s.
{_stretch(shell)}
{_mass(shell, dt, max(shell.pressures.values()))}
{LEFT_OUT}
{MEASURED}
{HALT}"""


def frames_note(actuator: CoarseActuator, dt: float, share: float) -> str:
    """Head of scene B."""
    mesh = actuator.mesh
    return f"""\
{_head(actuator.stack.name, "B: nine reference frames that carry the films (as the paper has it).")}
Mesh: {len(mesh.rest)} nodes, {mesh.height:.4g} mm high at the start; rest_position is flat.
{HEIGHTS}

The films move with nine frames of six degrees of freedom through a SkinningMapping with explicit
weights, linear in z. It reads a node's weights up to the first that is 0.
FITTED: nine frames cannot draw the pockets' edges in and are far too stiff with the true modulus.
Here E is {share:g} of the true one, so that 5 kPa in each chamber of the 3-DoF actuator lift it
as high as scene A: E t is {share * actuator.membrane:.4g} instead of {actuator.membrane:g}, and
bending stiffness likewise.
True mass, {actuator.mass:.3g} kg; dt {dt:g} s.
ARTIFICIAL: the solver's Rayleigh damping.
{LEFT_OUT}
Needs calibration against scene A or a measurement: not predictive. {MEASURED}
{HALT}"""


def volume_note(shell: Shell, dt: float, usual: float, pressure: float) -> str:
    """Head of scene C."""
    return f"""\
{_head(shell.name, "C: scene A, coarser, driven by volume. Needs the plugin SoftRobots.")}
Take a release of SoftRobots that matches that of SOFA.
{_mesh(shell)}

value is what the chamber holds above its start, in ul, met exactly and without a ramp; {usual:g}
stands in for 80 ul in 15 balloons of 5 mm. valueType="pressure" would take pressure x dt: 0.1 is
5 kPa at dt 0.02.
{_stretch(shell)}
{_mass(shell, dt, pressure)}
{LEFT_OUT}
{MEASURED}
{HALT}"""


def beam_note(
    actuator: CoarseActuator, height: float, area: float, spring: float, dt: float
) -> str:
    """Head of scene D."""
    return f"""\
{_head(actuator.stack.name, "D: a SURROGATE for control loops: nine frames as a beam.")}
No film bears anything here: it is only shown. Pressure acts on closed prisms, one a chamber,
carried by the frames; the beam has the stiffness of the chambers' springs on their axes.
{HEIGHTS}
FITTED at 5 kPa to scene A, for 15 balloons of 5 mm, and SCALED to this design: area dV/dH
{area:.4g} mm2 and spring k {spring:.4g} mN/mm a chamber, H0 {height:.4g} mm without pressure.
EA = N k H0 and EI = N k R^2 H0 / 2, R the distance of the chambers from the axis.
ARTIFICIAL: 1000 times the true mass of {actuator.mass:.3g} kg keeps it upright at 10 kPa; damping.
dt {dt:g} s.
{LEFT_OUT}
Needs calibration against scene A or a measurement: not predictive. {MEASURED}
{HALT}"""


def _head(name: str, title: str) -> str:
    # Two hyphens in a row would end an XML comment.
    return f"{name.replace('--', '- -')}: SOFA scene {title}\n{UNITS}"


def _mesh(shell: Shell) -> str:
    at_rest = "rest_position is flat, where the film is free of stress."
    return f"Mesh: {shell.about}\n{at_rest}\n{HEIGHTS}"


def _stretch(shell: Shell) -> str:
    values = ", ".join(f"{group.stiffness:.6g}" for group in shell.membranes)
    return f"SCALED: E t stands in for youngModulus (the element has no thickness): {values}."


def _mass(shell: Shell, dt: float, highest: float) -> str:
    mass = scaled_mass(shell, dt, highest)
    return (
        f"ARTIFICIAL: mass. The true one, {shell.mass:.3g} kg, jitters to NaN; totalMass is "
        f"{mass / shell.mass:.3g} times it:\nnodal mass / dt^2 = "
        f"{mass / len(shell.rest) / dt**2:.3g} mN/mm, enough for {highest:g} kPa. Change it with "
        f"pressure and dt ({dt:g} s).\nTransients and settling times are therefore artificial; so "
        "is the damping. Only the\nstate at rest means something."
    )
