"""Units of pressure and flow; apart from others, so that ``--help`` loads no validation."""

KILOPASCALS = {
    "kPa": 1.0,
    "Pa": 0.001,
    "MPa": 1000.0,
    "mbar": 0.1,
    "bar": 100.0,
    "psi": 6.894757293168,
}
"""How many kPa each unit is (psi: NIST SP 811, App. B)."""
MILLILITRES_PER_MINUTE = {"ml/min": 1.0, "ul/min": 0.001, "ml/s": 60.0, "l/min": 1000.0}
"""How many ml/min each unit is."""
