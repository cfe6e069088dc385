"""Files in this program's own form hold what ezdxf says they hold; all others are left to ezdxf."""

from __future__ import annotations

import os
import random
import re
import subprocess
import sys
from pathlib import Path

import pytest

from sbafab.cutting.dxf_read import ReadBack, as_written, read_profile, read_with_ezdxf
from sbafab.cutting.dxf_write import Surroundings, dxf_text
from sbafab.cutting.kerf import in_chords
from sbafab.cutting.order import cutting_order
from sbafab.cutting.properties import DxfProfile
from sbafab.errors import OutputError
from sbafab.geometry.region import Region

CHANGES = int(os.environ.get("SBAFAB_OWN_CHANGES", "60"))
SHEET = Surroundings(
    engraved=(((1.0, 1.0), (2.0, 1.5)), ((3.0, 1.0), (4.0, 1.0), (4.0, 2.0), (3.0, 1.0))),
    parting=(((0.0, 90.0), (80.0, 90.0)),),
    frame=(80.0, 90.0),
)


def told(text: str, by_form: bool) -> ReadBack | str:
    try:
        return read_profile(text) if by_form else read_with_ezdxf(text)
    except OutputError as error:
        return str(error).removeprefix("the DXF text: ")


def assert_alike(text: str) -> None:
    own, other = told(text, True), told(text, False)
    if isinstance(own, ReadBack) and isinstance(other, ReadBack):
        assert own.region.contours == other.region.contours
    assert own == other


@pytest.mark.parametrize("profile", ["bulges", "arcs", "chords"])
@pytest.mark.parametrize("name", ["plate", "island"])
def test_what_is_written_holds_what_ezdxf_finds(
    name: str, profile: DxfProfile, profiles: dict[str, Region]
) -> None:
    region = profiles[name].moved(20.0, 20.0)
    if profile == "chords":
        region = in_chords(region, None, 0.05)
    around = None if profile == "arcs" else SHEET
    properties = {"DESIGN": "Plättchen 2", "WARNING": "hot, PTFE (HF)"}
    text = dxf_text(cutting_order(region), properties, profile, around)
    found = as_written(text)
    assert found is not None
    assert found.properties == properties
    assert_alike(text)


def changed(text: str, chance: random.Random) -> str:
    """One line changed: a digit, another line in its place, none, twice, or two exchanged."""
    lines = text.split("\n")
    start = lines.index("ENTITIES")
    end = lines.index("ENDSEC", start)
    if chance.random() < 0.1:
        start, end = 0, len(lines) - 1
    at = chance.randrange(start, end)
    kind = chance.randrange(8)
    if kind < 4:
        digits = [i for i in range(start, end) if re.fullmatch(r"-?\d+\.\d+", lines[i])]
        at = chance.choice(digits)
        place = chance.choice([i for i, c in enumerate(lines[at]) if c.isdigit()])
        lines[at] = lines[at][:place] + chance.choice("0123456789") + lines[at][place + 1 :]
    elif kind == 4:
        lines[at] = chance.choice([*lines[start:end], "0.0", "1e3", " 62", "AcDbText", "\\U+00E9"])
    elif kind == 5:
        del lines[at]
    elif kind == 6:
        lines.insert(at, lines[at])
    else:
        other = chance.randrange(start, end)
        lines[at], lines[other] = lines[other], lines[at]
    return "\n".join(lines)


def test_changed_files_are_read_alike_or_left_to_ezdxf(profiles: dict[str, Region]) -> None:
    """The reader by form never takes a text for something else than ezdxf does."""
    chance = random.Random(12)
    contours = cutting_order(profiles["island"])
    texts = [dxf_text(contours, {"DESIGN": "a"}, profile) for profile in ("bulges", "arcs")]
    taken = 0
    for _ in range(CHANGES):
        text = changed(chance.choice(texts), chance)
        if as_written(text) is not None:
            taken += 1
            assert_alike(text)
    assert 0.2 * CHANGES < taken < 0.8 * CHANGES


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("  8\nCUT_OUTER\n", "  8\nCUT_OUTER\n 62\n5\n"),
        ("  8\nCUT_OUTER\n", "  8\nCUT_OUTER\n 60\n1\n"),
        ("  2\nCUT_INNER\n 70\n0\n", "  2\nCUT_INNER\n 70\n1\n"),
        ("$INSUNITS\n 70\n4", "$INSUNITS\n 70\n1"),
        ("  1\nsaid\n", "  1\nsa\\U+00EFd\n"),
        ("  1\nsaid\n", "  1\n said\n"),
    ],
)
def test_what_is_not_the_form_is_left_to_ezdxf(old: str, new: str, plate: Region) -> None:
    text = dxf_text(cutting_order(plate), {"DESIGN": "said"})
    assert old in text
    assert as_written(text) is not None
    assert as_written(text.replace(old, new, 1)) is None


def test_a_run_needs_no_ezdxf(tmp_path: Path) -> None:
    program = (
        "import contextlib, sys; from sbafab.cli import main\n"
        "with contextlib.suppress(SystemExit):\n"
        f"    main(['cut', '1dof-5mm', '-o', {str(tmp_path)!r}])\n"
        "sys.exit('ezdxf' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], check=True, capture_output=True)
    assert (tmp_path / "1dof-5mm" / "manifest.json").is_file()
