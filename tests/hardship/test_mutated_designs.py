"""Design files that were damaged: each builds and is checked, or is refused in one sentence.

``SBAFAB_MUTATIONS`` sets how many are tried; 2,000 take some minutes.
"""

from __future__ import annotations

import os
import random
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from sbafab.assemblies.build import assemble
from sbafab.assemblies.files import assembly_toml, load
from sbafab.design.files import template_names, templates_folder
from sbafab.design.records import Design, design_toml
from sbafab.errors import SbafabError
from sbafab.folders.order import make_order
from tests.quick import few

COUNT = int(os.environ.get("SBAFAB_MUTATIONS", "120"))
BATCHES = 8
LONGEST_SECONDS = 30
VALUES = [
    *("0", "-1", "1", "2.5", "1e-9", "0.001", "1000", "1e9", "1e400", "-1e400", "nan", "inf"),
    *("9223372036854775808", "0xfffffffffffffffff", "1_000", "true", "[]", "[1, 2]", "[[5]]"),
    *("{}", "{a = 1}", '""', '"5"', '"0.75 mm"', '"6 in"', '"1e400 m"', '"\\u0000"', '"\\n"'),
    *('"ü\u202e\U0001f388"', "'../../etc'", "1979-05-27", "07:32:00", '"' + "x" * 5000 + '"'),
    *("0x" + "f" * 5000, "[" + "5, " * 200 + "5]", '["bond-width"]', '"uncalibrated"', '"ears"'),
    *('"/dev/zero"', '"."', '"1dof"', '"lobed"', '"radial"', "0.7499999", "5.0000001", "1e-320"),
]


def flip_bytes(text: str, dice: random.Random) -> bytes:
    content = bytearray(text.encode())
    for _ in range(dice.randint(1, 6)):
        content[dice.randrange(len(content))] = dice.randrange(256)
    return bytes(content)


def change_lines(text: str, dice: random.Random) -> bytes:
    lines = text.split("\n")
    for _ in range(dice.randint(1, 4)):
        at = dice.randrange(len(lines))
        lines[at : at + 1] = dice.choice([[], [lines[at]] * 2, [dice.choice(lines), lines[at]]])
        lines = lines or [""]
    return "\n".join(lines).encode()


def change_values(text: str, dice: random.Random) -> bytes:
    lines = text.split("\n")
    assigned = [number for number, line in enumerate(lines) if "=" in line]
    for number in dice.sample(assigned, dice.randint(1, 3)):
        key = lines[number].partition("=")[0]
        lines[number] = f"{key}= {dice.choice(VALUES)}"
    return "\n".join(lines).encode()


def scale_numbers(text: str, dice: random.Random) -> bytes:
    """Sizes of the right kind that do not fit each other."""
    lines = text.split("\n")
    assigned = [n for n, line in enumerate(lines) if "=" in line and line.strip()[-1].isdigit()]
    for number in dice.sample(assigned, min(len(assigned), dice.randint(1, 5))):
        key, _, value = lines[number].partition("=")
        factor = dice.choice([0.5, 0.9, 0.999999, 1.1, 2, 3, 10])
        scaled = float(value) * factor
        lines[number] = f"{key}= {round(scaled) if '.' not in value else round(scaled, 7)}"
    return "\n".join(lines).encode()


def cut_short(text: str, dice: random.Random) -> bytes:
    return text.encode()[: dice.randrange(len(text.encode()))]


MUTATIONS: list[Callable[[str, random.Random], bytes]] = [
    *(flip_bytes, change_lines, change_values, change_values, scale_numbers, scale_numbers),
    cut_short,
]


def written_out(name: str) -> str:
    """A template with every key; the designs of an assembly are templates here, too."""
    found = load(name)
    if isinstance(found, Design):
        return design_toml(found)
    return assembly_toml(assemble(found)).replace("/design.toml", "")


def sources() -> list[str]:
    """Every template as it ships, and with every key written out."""
    shipped = [(templates_folder() / f"{n}.toml").read_text("utf-8") for n in template_names()]
    uncommented = [
        "\n".join(line.partition(" #")[0].rstrip() for line in text.split("\n") if line)
        for text in shipped
    ]
    richer = [written_out(name) for name in template_names()]
    return [*uncommented, *richer]


@contextmanager
def at_most(seconds: int) -> Iterator[None]:
    """Stops what hangs."""

    def too_slow(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, too_slow)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def refused(path: Path) -> str | None:
    """What is said of a design file that is refused, None of one that is checked."""
    try:
        make_order(load(path))
    except SbafabError as error:
        return str(error)
    return None


@pytest.mark.parametrize("batch", few(range(BATCHES), 3, setting="SBAFAB_MUTATIONS"))
def test_a_mutated_design_is_checked_or_refused_in_one_sentence(batch: int, tmp_path: Path) -> None:
    texts = sources()
    path = tmp_path / "design.toml"
    passed = 0
    for number in range(batch, COUNT, BATCHES):
        dice = random.Random(3000 + number)
        content = dice.choice(MUTATIONS)(dice.choice(texts), dice)
        path.write_bytes(content)
        try:
            with at_most(LONGEST_SECONDS):
                message = refused(path)
        except BaseException as error:
            error.add_note(f"mutation {number}: {content[:4000]!r}")
            raise
        if message is None:
            passed += 1
            continue
        assert message.isprintable(), (number, message)
        assert 20 < len(message) < 600, (number, message)
    # Were all refused at the door, nothing behind it was tried.
    assert 0 < passed < COUNT // BATCHES
