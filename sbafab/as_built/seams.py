"""Seams of a folder read back: the path of each file, and where it departs from the design."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path, PurePosixPath

from sbafab.as_built.cut_files import path_in_folder, sound_digest
from sbafab.as_built.expected import ExpectedLaminate
from sbafab.as_built.records import CLAIMS, DESIGNED, INTEGRITY, Problem
from sbafab.cutting.seam_files import deviation, read_seam, seam_path, stated_width
from sbafab.errors import OutputError
from sbafab.laminate.joints import Seam
from sbafab.laminate.laminate import Laminate
from sbafab.output.manifest import Manifest, SeamClaim
from sbafab.rules.limits import TOLERANCE


def read_seams(
    folder: Path, claims: Manifest, expected: ExpectedLaminate | None
) -> tuple[tuple[Seam, ...] | None, list[Problem]]:
    """Return the seams as their files draw them, and problems; None where the design has none.

    A path within a micrometre of the design's is the design's own.
    """
    designed = () if expected is None else expected.laminate.seams
    problems = _claim_problems(claims, designed)
    if not designed:
        return None, problems
    seams = []
    claimed = {claim.name: claim for claim in claims.seams}
    for seam in designed:
        claim = claimed.get(seam.name)
        if claim is None:
            continue
        try:
            seams.append(_read(folder, claim, seam, problems))
        except OutputError as error:
            reason = str(error).removeprefix(f"{PurePosixPath(claim.file or claim.name).name}: ")
            problems.append(Problem(INTEGRITY, f"seam {seam.name} ({claim.file}): {reason}"))
    return tuple(seams), problems


def _claim_problems(claims: Manifest, designed: tuple[Seam, ...]) -> list[Problem]:
    """Return what manifest and design say otherwise of the seams."""
    problems = []
    by_name = {seam.name: seam for seam in designed}
    for claim in claims.seams:
        seam = by_name.pop(claim.name, None)
        if seam is None:
            problems.append(Problem(CLAIMS, f"seam {claim.name} is of no seam of design.toml"))
            continue
        agree = (
            ("below", claim.below, seam.below),
            ("above", claim.above, seam.above),
            ("tool", claim.tool, seam.tool),
            ("kind", claim.kind, seam.kind),
            ("width", claim.width, seam.width),
            ("order", claim.order, seam.order),
            ("file", claim.file, seam_path(seam)),
        )
        problems += [
            Problem(
                CLAIMS,
                f"seam {claim.name}: {key} is {claimed} in the manifest and {stated} by "
                "design.toml",
            )
            for key, claimed, stated in agree
            if claimed != stated
        ]
    problems += [Problem(CLAIMS, f"the manifest lists no seam {name}") for name in by_name]
    return problems


def _read(folder: Path, claim: SeamClaim, seam: Seam, problems: list[Problem]) -> Seam:
    path = path_in_folder(folder, claim.file)
    sound_digest(path)
    chains, properties = read_seam(path)
    width = stated_width(properties)
    if width is None or abs(width - claim.width) > TOLERANCE:
        problems.append(
            Problem(
                CLAIMS,
                f"seam {seam.name} ({claim.file}): TOOL_WIDTH is "
                f"{properties.get('TOOL_WIDTH')!r}, and the manifest says {claim.width:g} mm",
            )
        )
    drawn = seam if deviation(chains, seam.path) is None else replace(seam, path=chains)
    if width is not None and abs(width - seam.width) > TOLERANCE:
        drawn = replace(drawn, width=width)
    return drawn


def seam_departures(laminate: Laminate, expected: ExpectedLaminate) -> list[Problem]:
    """Return the seams whose files differ from the design."""
    designed = {seam.name: seam for seam in expected.laminate.seams}
    problems = []
    for seam in laminate.seams:
        own = designed.pop(seam.name, None)
        if own is None or seam == own:
            continue
        what = deviation(seam.path, own.path) or f"it is {seam.width:g} mm wide, not {own.width:g}"
        problems.append(
            Problem(
                DESIGNED,
                f"seam {seam.name} is not what design.toml makes: {what}; regenerate the folder",
                (seam.below, seam.above),
            )
        )
    return problems
