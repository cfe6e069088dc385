"""Manifests that say what is not so."""

from __future__ import annotations

from typing import Any

from tests.faults.record import Fault, Kind, edited, no_lumen, of_text, told
from tests.faults.specimen import Specimen, mask, separator, wall

Claims = dict[str, Any]


def of_wall(name: str, **wrong: object) -> Fault:
    """A wrong claim about the lowest wall of the second balloon."""

    def put(specimen: Specimen) -> None:
        index = wall(specimen.clean).index
        specimen.doctor.set_manifest(lambda claims: claims["layers"][index - 1].update(wrong))

    return Fault(f"wrong {name} of a layer", "manifest-claims", put)


def order(specimen: Specimen) -> None:
    """Mask and separator listed in each other's place."""
    one, other = mask(specimen.clean).index - 1, separator(specimen.clean).index - 1

    def swap(claims: Claims) -> None:
        layers = claims["layers"]
        layers[one], layers[other] = layers[other], layers[one]

    specimen.doctor.set_manifest(swap)


def layer_lost(specimen: Specimen) -> None:
    """A chamber mask left out of the stack, its file deleted, everything else renumbered."""
    lost = mask(specimen.clean)
    specimen.doctor.path(lost.index).unlink()
    folder = specimen.doctor.folder

    def renumber(claims: Claims) -> None:
        claims["files"].pop(claims["layers"].pop(lost.index - 1)["file"])
        z = 0.0
        for index, layer in enumerate(claims["layers"], start=1):
            old = layer["file"]
            name = f"{index:03d}_{layer['material']}_{layer['role']}"
            layer.update(index=index, name=name, file=f"layers/{name}.dxf", z=round(z, 9))
            z += layer["thickness"]
            if layer["file"] != old:
                (folder / old).rename(folder / layer["file"])
                claims["files"][layer["file"]] = claims["files"].pop(old)

    specimen.doctor.set_manifest(renumber)


def file_hash(specimen: Specimen) -> None:
    index = wall(specimen.clean).index
    specimen.doctor.set_manifest(
        lambda claims: claims["files"].update({claims["layers"][index - 1]["file"]: "0" * 64})
    )


def limit_unsaid(text: str) -> str:
    """A file without its property LIMITS, and nothing else changed."""
    head, name, tail = text.partition("$CUSTOMPROPERTYTAG\n  1\nLIMITS\n")
    assert name
    value = tail.index("  9\n", tail.index("$CUSTOMPROPERTY\n"))
    return head.removesuffix("  9\n") + tail[value:]


LOWERED = ("rules.bond_width=0.7",)
KIND = Kind(
    "Manifests",
    "The cut files are as they were written; in the first row one is missing as well.",
    (
        Fault("mask left out of the stack", "manifest-claims", layer_lost),
        Fault("wrong order of layers", "manifest-claims", order),
        Fault("wrong hash of a file", "manifest-claims", file_hash, hashes=False),
        of_wall("thickness", thickness=0.05),
        of_wall("role", role="cap"),
        of_wall("height", z=0.5),
        of_wall("balloon", balloon=3),
        of_wall("area", area=1.0),
        of_wall("number of pieces", pieces=9),
        of_wall("list of bores", bores=[]),
        of_wall("pattern", pattern="P01"),
        told("wrong bond area", lambda m: m["interfaces"][0].update(bond_area=1.0)),
        told("wrong contact area", lambda m: m["interfaces"][0].update(contact_area=1.0)),
        told("wrong kind of interface", lambda m: m["interfaces"][1].update(kind="bond")),
        told("wrong place of a bore", lambda m: m["bores"][0].update(x=m["bores"][0]["x"] + 0.002)),
        told("wrong width of an inlet", lambda m: m["inlets"][0].update(width=1.7)),
        told(
            "wrong diameter of a pin", lambda m: m["registration"]["pins"][0].update(diameter=1.1)
        ),
        told("wrong size", lambda m: m["sizes"].update(width=9.0)),
        told("wrong number of films", lambda m: m["films"][0].update(layers=2)),
        told("wrong kerf", lambda m: m["kerf"]["TPE"].update(state="compensated", width=0.1)),
        told("wrong design", lambda m: m.update(design_sha256="0" * 64)),
        told("wrong waiver", lambda m: m.update(waived=["sealing"])),
        told(
            "wrong lowered limit",
            lambda m: m.update(lowered_limits=["bond_width 0.3 (paper 0.75)"]),
        ),
        told(
            "lowered limit that the manifest does not name",
            lambda m: m.update(lowered_limits=[]),
            settings=LOWERED,
        ),
        edited(
            "lowered limit that a file does not name",
            "manifest-claims",
            lambda s: s.doctor.path(wall(s.clean).index),
            of_text(limit_unsaid),
            settings=LOWERED,
        ),
        told("wrong lumen", lambda m: m.update(lumen=3.0), why_not=no_lumen),
    ),
)
