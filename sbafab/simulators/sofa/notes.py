"""What stands at the top of every scene: what it is, what is scaled, fitted or artificial."""

from __future__ import annotations

from sbafab.simulators.coarse.actuator import CoarseActuator
from sbafab.simulators.coarse.mesh import CoarseMesh
from sbafab.simulators.sofa.parts import NODAL_STIFFNESS, scaled_mass

UNITS = "Units: mm, kg, s; so force mN, pressure and modulus kPa, volume ul."
REFERENCE = """\
the 3-DoF actuator with 15 balloons of 5 mm, one core, chamber1 lying along +x; heights are of
mid-surfaces, add the films' thickness (1.14 mm) to compare with a real one"""
LEFT_OUT = "Not in it: gravity, self contact, inlet tabs and strips."
HALT = """\
If the log shows Null determinant, Division by zero, NaN or [ERROR], the run is void, although
runSofa then still ends with exit code 0."""


def shell_note(actuator: CoarseActuator, dt: float) -> str:
    """Head of scene A."""
    return f"""\
{_head(actuator, "A: the whole actuator as a coarse shell, core components only.")}
{_mesh(actuator, actuator.mesh)}

Pressure: each chamber has its own SurfacePressureForceField; pressure and pressureLowerBound
(just below it) are what it holds, pressureSpeed how fast it gets there in kPa/s.
SCALED: E t stands in for youngModulus (the element has no thickness): {actuator.membrane:g} for
one film, {2 * actuator.membrane:g} for two bonded.
{_mass(actuator, dt)}
{LEFT_OUT}

Measured with SOFA 25.06 on a mesh of this kind, 58 to 60 steps/s, 8 s of simulated time, for
{REFERENCE}:
  kPa in chambers 1, 2, 3    tip x, y, z in mm       bend in degrees
  1, 1, 1                     0,     0,     8.87       0
  2, 2, 2                     0,     0,    11.19       0
  5, 5, 5                     0,     0,    15.04       0.5
  10, 10, 10                  0,     0,    19.0        1.7
  5, 5, 0                    -3.08, -5.36,  9.29      81
  2, 0, 0                    -2.70,  0,     4.98      66
  5, 0, 0                    -4.66,  0,     4.94      96
  10, 0, 0                   -6.56,  0,     4.78     120
The measured plate weighed what a plain disc of 15 mm weighs; this one has the lobed outline that
is cut and gives way more round its pockets: expect it about 1 mm higher at 5, 5, 5.
Not mesh converged: three meshes gave 15.0 to 18.6 mm at 5, 5, 5. Bending still creeps at 8 s.
{HALT}"""


def frames_note(actuator: CoarseActuator, dt: float, share: float) -> str:
    """Head of scene B."""
    return f"""\
{_head(actuator, "B: nine reference frames that carry the films (the paper's description).")}
{_mesh(actuator, actuator.mesh)}

The films move with nine frames of six degrees of freedom through a SkinningMapping with explicit
weights, linear in z: its default weights give 8.3 mm and 4 degrees.
FITTED: nine frames cannot draw the pockets' edges in and are far too stiff with the true modulus
(5, 5, 5 kPa: 11.0 mm; 5, 0, 0: 24 degrees). Here E is {share:g} of the true one: E t is
{share * actuator.membrane:g} instead of {actuator.membrane:g}, and bending stiffness likewise.
0.25 to 0.35 gave 14.9 to 16.9 mm and 49 to 68 degrees with SOFA 25.06, for
{REFERENCE}.
True mass, {actuator.mass:.3g} kg; dt {dt:g} s; 12 to 31 ms a step, stable to 10 kPa.
ARTIFICIAL: the solver's Rayleigh damping.
{LEFT_OUT}
Needs calibration against scene A or a measurement: not predictive.
{HALT}"""


def volume_note(actuator: CoarseActuator, mesh: CoarseMesh, dt: float, usual: float) -> str:
    """Head of scene C."""
    return f"""\
{_head(actuator, "C: scene A driven by volume. Needs the plugin SoftRobots.")}
Take a release of SoftRobots that matches that of SOFA.
{_mesh(actuator, mesh)}

value is what the chamber holds above its start, in ul, met exactly and without a ramp; {usual:g}
stands in for 80 ul in 15 balloons of 5 mm. The start is chosen here, so that 80 ul more come near
what 5 kPa hold. valueType="pressure" would take pressure x dt: 0.1 is 5 kPa at dt 0.02.
SCALED: E t stands in for youngModulus, as in scene A.
{_mass(actuator, dt)}
{LEFT_OUT}

Measured with SOFA 25.06 and SoftRobots, 18.5 ms a step, for
{REFERENCE}:
  80, 80, 80 ul: 15.1 mm;  80, 0, 0 ul: 66 degrees.
{HALT}"""


def beam_note(
    actuator: CoarseActuator, height: float, area: float, spring: float, dt: float
) -> str:
    """Head of scene D."""
    return f"""\
{_head(actuator, "D: a SURROGATE for control loops: nine frames as a beam.")}
No film bears anything here: it is only shown. Pressure acts on closed prisms, one a chamber,
carried by the frames; the beam has the stiffness of the chambers' springs on their axes.
FITTED at 5 kPa to scene A, for 15 balloons of 5 mm: area dV/dH = 10.9 mm2 and k = 7 mN/mm a
chamber, H0 = 7.2 mm, EA = 3 k H0, EI = 1.5 k 4.25^2 H0.
SCALED to this design, and not fitted anew: area {area:.4g} mm2, k {spring:.4g} mN/mm,
H0 {height:.4g} mm.
ARTIFICIAL: 1000 times the true mass of {actuator.mass:.3g} kg keeps it upright at 10 kPa; damping.
dt {dt:g} s.
{LEFT_OUT}

Measured with SOFA 25.06, 2,000 to 8,000 steps/s, for
{REFERENCE}:
  5, 5, 5 kPa: 15.05 mm;  5 kPa in one chamber or in two: 70 and 71 degrees;
  2 kPa in one chamber: 28 degrees, where scene A bends by 66.
Needs calibration against scene A or a measurement: not predictive.
{HALT}"""


def _head(actuator: CoarseActuator, title: str) -> str:
    # Two hyphens in a row would end an XML comment.
    name = actuator.stack.name.replace("--", "- -")
    return (
        f"{name}: SOFA scene {title}\n{UNITS}\nThis file itself has not been run by its generator."
    )


def _mesh(actuator: CoarseActuator, mesh: CoarseMesh) -> str:
    triangles = len(mesh.single) + len(mesh.double)
    held = mesh.volume(actuator.stack.chambers[0]) / actuator.balloons
    return (
        f"Mesh: {len(mesh.rest)} nodes, {triangles} triangles, inflated to {mesh.height:.4g} mm "
        f"({held:.3g} ul a balloon\nbetween its eight-sided rings; parabolas of constant length). "
        "rest_position is flat, where the\nfilm is free of stress."
    )


def _mass(actuator: CoarseActuator, dt: float) -> str:
    mass = scaled_mass(actuator, dt)
    return (
        f"ARTIFICIAL: mass. The true one, {actuator.mass:.3g} kg, jitters to NaN; totalMass is "
        f"{mass / actuator.mass:.3g} times it, from\nnodal mass / dt^2 = "
        f"{NODAL_STIFFNESS:.2f} mN/mm, the rule that held: change it with dt ({dt:g} s).\n"
        "Transients and settling times are therefore artificial; so is the damping. Only the\n"
        "state at rest means something."
    )
