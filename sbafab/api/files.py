"""Templates, keys and units of design files, and findings, for every command."""

from __future__ import annotations

from sbafab.design.files import refuse_file_as_folder, template_names, template_summaries, write_new
from sbafab.design.kits import write_kit
from sbafab.design.units import (
    KILOPASCALS,
    MEGAPASCALS,
    MILLILITRES_PER_MINUTE,
    MILLIMETRES,
    in_first_unit,
    share_of,
)
from sbafab.rules.finding import Finding, counted, decisive
