"""Which keys a search may change, as people say it: ``KEY=LOW:HIGH:STEP``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sbafab.design.form import Free
from sbafab.design.messages import shown
from sbafab.design.records import Design
from sbafab.design.writing import keys_of
from sbafab.errors import DesignError
from sbafab.search.space import numbers_of
from sbafab.search.vary import read_varied, refuse_unknown


def read_free(
    design: Design, texts: Sequence[str], fixed: Sequence[str] = (), given: Sequence[str] = ()
) -> tuple[Free, ...]:
    """The family's own keys without those ``fixed``, and those of the ``texts`` in their place.

    Keys that are ``given`` by hand stay as they are, but for lists, which are scaled as a whole;
    what the design must fit gives its chamber. Raises DesignError.
    """
    keys = {key: value for key, value, _ in keys_of(design)}
    given = [key for key in given if not numbers_of(keys.get(key))]
    varied = [_stepped(text) for text in texts]
    refuse_unknown(design, [read_varied(text, "--free") for text in texts], "--free")
    own = {one.key: one for one in design.free}
    if any(key.startswith("fits.") for key in given):
        own.pop("chamber.diameter", None)
    for key in given:
        own.pop(key, None)
    for key in dict.fromkeys(fixed):
        if key in given:
            continue
        if key not in own:
            raise DesignError(
                f"--fix {shown(key)}: a search changes only {', '.join(own) or 'nothing'} by itself"
            )
        del own[key]
    # What is named is free whatever the requirements name.
    own |= {one.key: one for one in varied}
    if "stack.balloons" in own and numbers_of(keys.get("chamber.diameter")):
        raise DesignError(
            "--free stack.balloons: chamber.diameter lists a diameter for each balloon, and a "
            "search scales that list; leave it out, or give one diameter"
        )
    return tuple(own.values())


def _stepped(text: str) -> Free:
    found = read_varied(text, "--free")
    numbers = [one for one in found.values if isinstance(one, int | float)]
    parts = text.partition("=")[2].split(":")
    if len(parts) != 3 or len(numbers) != len(found.values):
        raise DesignError(
            f"--free {shown(text)} is not KEY=LOW:HIGH:STEP; write for example "
            "--free chamber.diameter=3:12:0.1"
        )
    step = numbers[1] - numbers[0] if len(numbers) > 1 else 1
    return replace(Free(found.key, numbers[0], numbers[-1], 1), step=round(step, 9))
