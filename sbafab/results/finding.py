"""Finding records by what a traveller's code says, by a serial or by a design's name."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from sbafab.errors import DesignError
from sbafab.results.records import Build, Record

_HASH = re.compile(r"\b[0-9a-f]{8,64}\b")


def found_by(
    text: str, serial: str, records: Sequence[Record], builds: Mapping[str, Build]
) -> list[Record]:
    """Records of the design whose hash, or its first eight digits or more, the text holds.

    With them come those of other designs that build the same actuator. Else those of a serial or of
    a design of that name, or the one of that number; of these only those of ``serial``, if one is
    given. Raises DesignError where there are none.
    """
    text = text.strip()
    hashes = _HASH.findall(text.lower())
    actuators = {
        build.actuator
        for build in builds.values()
        if any(h.startswith(part) for part in hashes for h in (build.sha256, build.actuator))
    }
    found = [record for record in records if builds[record.design_sha256].actuator in actuators]
    if not found:
        found = [
            record
            for record in records
            if text in (record.serial, builds[record.design_sha256].name, str(record.id))
        ]
    found = [record for record in found if serial in ("", record.serial)]
    if not found:
        asked = " ".join([*text.split(), serial]).strip()[:60]
        raise DesignError(
            f"no record goes with {asked!r}; give a serial, a design's name, 8 "
            "digits or more of its sha256, or what the traveller's code says"
        )
    return found
