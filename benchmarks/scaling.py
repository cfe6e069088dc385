"""Time of rules and cut files for stacks of some numbers of balloons, copying files aside."""

from __future__ import annotations

import hashlib
import shutil
import tempfile
import time
from pathlib import Path

DESIGN = "3dof-15mm"


def rules_and_cut_files(balloons: int, turn: int) -> float:
    """Seconds from the design to its findings and cut files, without the copies' share."""
    from sbafab.actuators import build, load_design
    from sbafab.cutting.kerf import compensated_paths
    from sbafab.cutting.layer_files import write_layer_files
    from sbafab.folders.build import cut_settings
    from sbafab.rules.deck import run_deck

    another = f"chamber.diameter={5 + turn / 1000}"
    design = load_design(DESIGN, [f"stack.balloons={balloons}", another])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        began = time.process_time()
        laminate = build(design)
        run_deck(laminate, design)
        settings = cut_settings(design, ())
        paths = compensated_paths(laminate, settings)
        files = write_layer_files(laminate, paths, folder, settings)
        taken = time.process_time() - began
        copies = len(files) - len(laminate.patterns)
        return taken - copies * _copy_time(folder / min(files))


def _copy_time(path: Path, times: int = 20) -> float:
    """Seconds to write a cut file once more and to hash it."""
    began = time.process_time()
    for _ in range(times):
        copy = shutil.copyfile(path, path.with_suffix(".copy"))
        hashlib.sha256(copy.read_bytes()).hexdigest()
    return (time.process_time() - began) / times
