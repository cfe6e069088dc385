"""Assemblies from the templates, changed key by key."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from sbafab.assemblies.build import Assembled, assemble
from sbafab.assemblies.files import assembly_of
from sbafab.design.files import read_toml, templates_folder


@pytest.fixture
def tables() -> Callable[[str], dict[str, Any]]:
    """The tables of a template."""
    return lambda name: read_toml(templates_folder() / f"{name}.toml")


@pytest.fixture
def put_together() -> Callable[[dict[str, Any]], Assembled]:
    """An assembly from tables as a file holds them."""
    return lambda data: assemble(assembly_of(data, templates_folder() / "some.toml"))
