"""Lines and facts on standard output."""

from __future__ import annotations

import pytest

from sbafab.cli.printing import print_facts


def test_a_path_longer_than_the_line_is_printed_whole(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    folder = "/home/lab/" + "actuators/" * 9 + "3dof-15mm"
    print_facts([("folder", folder)])
    told = capsys.readouterr().out.splitlines()
    assert "".join(line[len("folder") :].strip() for line in told) == folder
