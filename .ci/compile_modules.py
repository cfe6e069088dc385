"""Compiles the modules that most time is spent in: ``python .ci/compile_modules.py FOLDER``.

mypyc makes C of them as they stand, and the compiler of this machine what Python imports; both come
to lie in the folder, by package. What is compiled gives the same results, and the same bytes.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
GEOMETRY = (
    "apart",
    "arrangement",
    "boolean",
    "boundary_side",
    "centroid",
    "chain_sums",
    "corners",
    "edge_table",
    "edges",
    "ends",
    "facets",
    "facing_places",
    "intersect",
    "kept",
    "nanometres",
    "nearby",
    "offset",
    "once",
    "pieces",
    "pool",
    "question",
    "region",
    "rings",
    "runs",
    "samples",
    "shapes",
    "side_table",
    "similarity",
    "tidy",
    "width",
    "width_bounds",
)
RULES = (
    "alike",
    "bond_width",
    "boundary",
    "channel_clear",
    "channels",
    "draws",
    "facing_films",
    "film_limits",
    "forms",
    "freedoms",
    "likely_builds",
    "lowered",
    "margin_rows",
    "margins",
    "mask_overhang",
    "narrow_places",
    "pin_fit",
    "pin_holes",
    "random_builds",
    "registration_nominal",
    "registration_worst_case",
    "registration_yield",
    "sealing",
    "tube_fit",
    "voids",
)
COMPILED = (
    *(f"sbafab/geometry/{name}.py" for name in GEOMETRY),
    *(f"sbafab/rules/{name}.py" for name in RULES),
)
"""Not those whose tests put other functions in their place, nor what decorates functions."""
NEEDS = ("mypy[mypyc]>=2.4,<3", "setuptools>=65")
TYPES = """
[mypy]
follow_imports = skip
ignore_missing_imports = True
disable_error_code = var-annotated
[mypy-numpy.*]
follow_imports_for_stubs = True
"""
"""The types of other modules are not asked for, which saves minutes; the checks ask for all."""
# As Python rounds: products and sums are not made one step.
ROUNDING = () if os.name == "nt" else ("-ffp-contract=off",)


def compile_into(folder: Path) -> list[Path]:
    """The modules, compiled: their files in the folder, relative to it.

    Raises SystemExit where there is no compiler or mypy objects.
    """
    from mypyc.build import mypycify
    from setuptools import Distribution

    os.chdir(ROOT)
    with tempfile.TemporaryDirectory() as scratch:
        types = Path(scratch, "types.ini")
        types.write_text(TYPES)
        modules = mypycify(
            [f"--config-file={types}", *COMPILED],
            opt_level="2",
            debug_level="0",
            target_dir=scratch,
            group_name="sbafab",
        )
        for module in modules:
            module.extra_compile_args += ROUNDING
        work = Distribution({"name": "sbafab", "ext_modules": modules}).get_command_obj("build_ext")
        work.build_lib, work.build_temp = str(folder), scratch
        work.ensure_finalized()
        work.run()
    return sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())


if __name__ == "__main__":
    for path in compile_into(Path(sys.argv[1]).resolve()):
        print(path.as_posix())
