"""Good folders to copy, and checks that parse equal files once."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager

import pytest

from sbafab.folders.as_cut import CutPart
from tests.faults.catalogue import Goods, good_folders
from tests.faults.once import remembering
from tests.shared import shared_folder


@pytest.fixture(scope="session")
def goods(tmp_path_factory: pytest.TempPathFactory) -> Goods:
    root = shared_folder(tmp_path_factory) / "good"
    root.mkdir(exist_ok=True)
    return good_folders(root)


@pytest.fixture(scope="session")
def parts() -> dict[str, CutPart]:
    return {}


@pytest.fixture(scope="session")
def remember(
    tmp_path_factory: pytest.TempPathFactory,
) -> Callable[[], AbstractContextManager[None]]:
    return remembering(tmp_path_factory.mktemp("anew"))
