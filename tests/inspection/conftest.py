"""Output folders whose sheets are scanned: small, so that a scan is."""

from __future__ import annotations

from pathlib import Path

import pytest

from sbafab.cli import main


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six balloons on small sheets: pieces with inlets and without, with bores and without."""
    return cut(tmp_path_factory.mktemp("cut"), "1dof-10mm")


@pytest.fixture(scope="session")
def lobed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Masks of one size whose bores lie off their middle, separators and washers."""
    return cut(tmp_path_factory.mktemp("cut"), "3dof-15mm")


def cut(out: Path, template: str, *options: str) -> Path:
    with pytest.raises(SystemExit) as stop:
        main(["cut", template, "-o", str(out), "-q", *options])
    assert stop.value.code == 0
    return out / template
