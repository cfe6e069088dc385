"""The earlier run that lies where a new one is to be written: which of its files stay, and when."""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from sbafab.design.files import shown
from sbafab.design.records import Design, dotted, resolved
from sbafab.errors import OccupiedError, OutputError
from sbafab.folders.artefacts import artefacts, tops_of
from sbafab.folders.build import Build
from sbafab.folders.manifest import carried_over, file_hash, file_names, identity
from sbafab.folders.swap import listed_files, read_manifest
from sbafab.simulators.simulator import NAMES as SIMULATORS

MOST_KEYS = 3
"""Keys that a message names, at most."""
RESULTS = "result.json"
"""Result of a simulator; a folder without it holds input only."""
WHOLE = {"layers", "sheets", "preview", "predict"}
"""Folders that a run which writes into them writes whole."""


def would_replace(
    target: Path, mine: Mapping[str, Any] | None, replaced: Collection[str] = ()
) -> list[str]:
    """Return files worth keeping of another design's run in ``target`` that a new run would lose.

    ``mine`` identifies the new run's design and version as its manifest does; ``replaced`` are the
    files and folders that it writes itself.
    """
    old = read_manifest(target)
    if old is None or (mine is not None and carried_over(old, mine)):
        return []
    # What a design that breaks a rule does not get.
    worth = {*tops_of("cut", "press", "mesh", "predict", *SIMULATORS)} - set(replaced)
    return [path for path in listed_files(target) if worth & set(path.split("/"))]


def removed_files(listed: Sequence[str], index: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the files that an earlier run listed and the new manifest does not."""
    return tuple(path for path in listed if path not in index["files"])


def refuse_to_replace(target: Path, build: Build, replaced: Collection[str]) -> None:
    """Raises OccupiedError where a run that writes ``replaced`` would lose others' files."""
    mine = identity(build)
    lost = would_replace(target, mine, replaced)
    if lost:
        names = dict.fromkeys(path.partition("/")[0] for path in lost)
        raise OccupiedError(
            f"{target} holds {', '.join(names)} {_unlike(target, build.design, mine)}; take "
            f"{target / 'design.toml'} for the design that was run there, or give this one a "
            "folder of its own with --set name=NAME or -o"
        )


def _unlike(target: Path, design: Design, mine: Mapping[str, Any]) -> str:
    """Return the differences of another run in ``target``, so far as its design.toml is legible."""
    old = read_manifest(target) or {}
    try:
        text = (target / "design.toml").read_text(encoding="utf-8")
        there = dict(dotted(tomllib.loads(text)))
    except (OSError, ValueError):
        there = {}
    here = dict(dotted(resolved(design)))
    keys = [key for key in {**there, **here} if there.get(key) != here.get(key)]
    if there and keys:
        differences = [
            f"{key} = {_value(there, key)} there, {_value(here, key)} here"
            for key in keys[:MOST_KEYS]
        ]
        more = len(keys) - len(differences)
        rest = f"; and {more} more keys" if more else ""
        return f"of another design ({'; '.join(differences)}{rest})"
    if old.get("generator") != mine["generator"]:
        return f"of another version ({shown(old.get('generator'))}, not {mine['generator']})"
    return "of a run with other settings"


def _value(keys: Mapping[str, object], key: str) -> str:
    return shown(keys[key]) if key in keys else "not set"


def carry_over(old_folder: Path, folder: Path, index: dict[str, Any]) -> None:
    """Copy files of the old run that this one did not write, if they are of the same design.

    ``index`` is the new manifest, completed by their entries. Raises OutputError where results of a
    simulator would be lost to input of other settings.
    """
    old = read_manifest(old_folder)
    if old is None or not carried_over(old, index):
        return
    written = file_names(folder)
    files = old.get("files")
    existing = set(file_names(old_folder))
    carried: set[str] = set()
    # Results belong to the input beside them: with other input they go, whole.
    anew: set[str] = {
        name
        for name in SIMULATORS
        if any(
            _differs(path, old_folder, folder) for path in written if path.startswith(f"{name}/")
        )
    }
    for name in anew:
        if f"{name}/{RESULTS}" in existing and f"{name}/{RESULTS}" not in written:
            raise OutputError(
                f"{old_folder / name} holds results of other settings than these; choose another "
                "folder with -o, or remove that one"
            )
    old_meshes = old.get("mesh_statistics")
    if "mesh_statistics" in index and old_meshes not in (None, index["mesh_statistics"]):
        anew.update(tops_of("mesh"))
    anew |= WHOLE & {path.partition("/")[0] for path in written}
    for path, digest in (files if isinstance(files, dict) else {}).items():
        if path in written or path not in existing or not _may_stay(path, anew):
            continue
        if file_hash(old_folder / path) == digest:
            target = folder / path
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(old_folder / path, target)
            carried.add(path)
    layers, meshes, plate = old.get("layers"), old.get("meshes"), old.get("fixture")
    if _are_files(layers, carried):
        index["layers"] = layers
        index["fixture"] = plate if plate in carried else None
        # How the layers that stay were cut stays with them.
        index.update({name: old[name] for name in ("curves", "seams") if name in old})
        if _are_files(old.get("sheets"), carried):
            index["sheets"], index["films"] = old["sheets"], old.get("films")
    if isinstance(meshes, list):
        kept_meshes = [mesh for mesh in meshes if _are_files([mesh], carried)]
        index["meshes"] += kept_meshes
        if any(mesh.get("kind") == "volume" for mesh in kept_meshes):
            index["mesh_statistics"] = old.get("mesh_statistics", {})


def _may_stay(path: str, anew: Collection[str]) -> bool:
    """Return True if an old run's file belongs to a part of a run that is not written again."""
    first = path.partition("/")[0]
    is_part = any(row.part and row.top == first for row in artefacts())
    return is_part and first not in anew


def _differs(path: str, old_folder: Path, folder: Path) -> bool:
    """True if a file that a new run wrote was not in the old folder, or had other contents."""
    old = old_folder / path
    return not old.is_file() or old.read_bytes() != (folder / path).read_bytes()


def _are_files(entries: object, carried: set[str]) -> bool:
    """True if manifest entries name files that were all carried over."""
    return (
        isinstance(entries, list)
        and bool(entries)
        and all(isinstance(entry, dict) and entry.get("file") in carried for entry in entries)
    )
