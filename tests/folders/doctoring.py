"""Faults put into a written folder: its cut files drawn anew, its manifest made to agree or not."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sbafab.cutting.dxf_read import read_profile
from sbafab.cutting.dxf_write import dxf_text
from sbafab.cutting.sequence import cutting_sequence
from sbafab.geometry.region import Region


@dataclass(frozen=True)
class Doctor:
    """An output folder to put faults into; layers are counted from 1."""

    folder: Path

    @property
    def manifest(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads((self.folder / "manifest.json").read_text())
        return found

    def set_manifest(self, change: Callable[[dict[str, Any]], object]) -> None:
        """Rewrites the manifest as ``change`` leaves it."""
        manifest = self.manifest
        change(manifest)
        (self.folder / "manifest.json").write_text(json.dumps(manifest))

    def path(self, layer: int) -> Path:
        return self.folder / self.manifest["layers"][layer - 1]["file"]

    def redraw(self, layer: int, change: Callable[[Region], Region]) -> None:
        """The layer's file with its profile changed and everything else as it was."""
        found = read_profile(self.path(layer))
        contours = cutting_sequence(change(found.region))
        self.path(layer).write_text(dxf_text(contours, found.properties), newline="\n")

    def edit(self, layer: int, old: str, new: str) -> None:
        """The layer's file with a piece of its text replaced where it first occurs."""
        text = self.path(layer).read_text()
        assert old in text
        self.path(layer).write_text(text.replace(old, new, 1), newline="\n")

    def rehash(self) -> None:
        """Hashes of the files as they are now, so that they alone give no fault away."""

        def rehashed(manifest: dict[str, Any]) -> None:
            for path in manifest["files"]:
                data = (self.folder / path).read_bytes()
                manifest["files"][path] = hashlib.sha256(data).hexdigest()

        self.set_manifest(rehashed)
