"""Units of pressure; apart from the other units, so that ``--help`` loads no validation."""

KILOPASCALS = {
    "kPa": 1.0,
    "Pa": 0.001,
    "MPa": 1000.0,
    "mbar": 0.1,
    "bar": 100.0,
    "psi": 6.894757293168,
}
"""How many kPa each unit is (psi: NIST SP 811, App. B)."""
