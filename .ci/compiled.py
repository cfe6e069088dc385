"""What hatchling puts into a wheel beside the source: with ``SBAFAB_COMPILE=1`` compiled modules.

Without it, and for an installation that follows the source, nothing is compiled.
"""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

ASKED = os.environ.get("SBAFAB_COMPILE", "") not in ("", "0")


class CompiledHook(BuildHookInterface):
    """Compiles, where it is asked for, and names the wheel after Python and machine."""

    def dependencies(self) -> list[str]:
        return list(runpy.run_path(str(self._script))["NEEDS"]) if ASKED else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if not ASKED or version == "editable":
            return
        self._folder = tempfile.TemporaryDirectory()
        folder = Path(self._folder.name)
        subprocess.run([sys.executable, self._script, folder], check=True)
        for path in folder.rglob("*"):
            if path.is_file():
                build_data["force_include"][str(path)] = path.relative_to(folder).as_posix()
        build_data["pure_python"] = False
        build_data["infer_tag"] = True

    @property
    def _script(self) -> Path:
        return Path(self.root) / ".ci" / "compile_modules.py"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if hasattr(self, "_folder"):
            self._folder.cleanup()
