"""Every text of a design or an assembly can be written into XML, or its field is refused."""

from __future__ import annotations

from typing import Any, get_args
from xml.etree import ElementTree

import pytest
from pydantic import BaseModel

from sbafab.actuators import FAMILIES, build
from sbafab.assemblies.files import assembly_of
from sbafab.assemblies.records import KINDS
from sbafab.design.files import key_paths, read_toml, templates_folder
from sbafab.design.records import validated
from sbafab.errors import DesignError
from sbafab.reports.layers_svg import layers_svg

RECORDS = {family: record for family, (record, _) in FAMILIES.items()}
FORBIDDEN = ["\0", "\x01", "\x08", "\x0b", "\r", "\x1b[31m", "\x7f", "\x85", "\ud800", "\uffff"]
ALLOWED = "<a & b> \u00e9\t\u4e2d\U0001f600 ]]> \"'"


def holds_text(annotation: Any) -> bool:
    if annotation is str:
        return True
    return any(holds_text(inner) for inner in get_args(annotation))


def texts(record: type[BaseModel]) -> list[str]:
    """Return the keys of free texts; names of rules are listed."""
    paths = key_paths(record).items()
    return [path for path, kind in paths if holds_text(kind) and path != "rules.waive"]


def nested(path: str, value: object) -> dict[str, Any]:
    for part in reversed(path.split(".")):
        value = {part: value}
    return value  # type: ignore[return-value]


DESIGN_TEXTS = [
    (family, path)
    for family, record in RECORDS.items()
    for path in texts(record)
    if record.uses(path)
]


@pytest.mark.parametrize(("family", "path"), DESIGN_TEXTS)
def test_a_control_character_is_refused(family: str, path: str) -> None:
    # One of them: all are refused by one pattern, and each comes to many keys.
    letter = FORBIDDEN[len(path) % len(FORBIDDEN)]
    is_list = "tuple[" in str(key_paths(RECORDS[family])[path])
    text = f"a{letter}b"
    data = {"name": "x", "family": family, **nested(path, [text] if is_list else text)}
    with pytest.raises(DesignError) as caught:
        validated(data, RECORDS, templates_folder())
    said = str(caught.value)
    assert said.startswith(f"{path}.0 = " if is_list else f"{path} = ")
    assert said.isprintable()
    if path == "name":
        assert "must be 1 to 64 letters" in said or "plain text" in said
    elif letter == "\ud800":
        assert "must be plain text" in said
    else:
        assert f"remove the character U+{ord(letter[0]):04X} at position 2" in said


PART_TEXTS = [
    (kind, path) for kind, record in KINDS.items() for path in texts(record) if path != "set"
]
NEEDED = {"width": 5, "length": 5, "thickness": 1, "material": "film", "design": "1dof-5mm"}


@pytest.mark.parametrize(("kind", "path"), PART_TEXTS)
def test_a_control_character_in_a_part_is_refused(kind: str, path: str) -> None:
    file = templates_folder() / "brace.toml"
    data = read_toml(file)
    needed = {key: NEEDED[key] for key in KINDS[kind].model_fields if key in NEEDED}
    data["parts"]["more"] = {"kind": kind, **needed, path: "a\x01b"}
    with pytest.raises(DesignError, match=rf"more\.{path} = .* remove the character U\+0001"):
        assembly_of(data, file)


def test_other_letters_are_written_as_they_are() -> None:
    films = {
        "tpe": {"product": f"TPE{ALLOWED}", "thickness": 0.05},
        "ptfe": {"product": f"PTFE{ALLOWED}"},
    }
    order = {"note": f"one\ntwo{ALLOWED}", "made_for": ALLOWED}
    data = {"name": "x", "family": "1dof", "films": films, "order": order}
    picture = layers_svg(build(validated(data, RECORDS, templates_folder())))
    said = "".join(ElementTree.fromstring(picture).itertext())
    assert "".join(ALLOWED.split()) in "".join(said.split())
