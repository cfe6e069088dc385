"""The record page: what it is told of a design, what it stores, and what a phone is answered."""

from __future__ import annotations

import base64
from io import BytesIO
from pathlib import Path

import pytest
from PIL import Image

from sbafab import api
from sbafab.lab.store import Lab
from sbafab.reports.traveller.record_sheet import HISTORY_FIELDS
from sbafab.studio.app import Studio, app
from tests.studio.asking import Client

TOKEN = "right-token"
HEADERS = {"X-Sbafab-Token": TOKEN}
PHONE = "192.168.1.20"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("SBAFAB_LAB", raising=False)
    (tmp_path / "two.toml").write_text(
        api.template("1dof-5mm") + "\n[rules]\nyield_builds = 100\n", encoding="utf-8"
    )
    return tmp_path


@pytest.fixture
def client(folder: Path) -> Client:
    return Client(app(Studio(folder, TOKEN)), base_url="http://127.0.0.1:8417")


def photograph() -> bytes:
    written = BytesIO()
    Image.new("RGB", (40, 30), "red").save(written, "JPEG")
    return written.getvalue()


def test_the_form_has_the_paper_s_fields_in_its_order(client: Client, folder: Path) -> None:
    assert client.get("/record").status_code == 200
    assert client.get("/api/record").status_code == 401
    choices = client.get("/api/record", headers=HEADERS).json()
    assert choices["files"] == ["two.toml"]
    assert choices["lab"] == str(folder / "lab.sqlite")
    answer = client.post("/api/record/sheet", json={"design": "two.toml"}, headers=HEADERS)
    tables = answer.json()["tables"]
    assert [table["title"] for table in tables] == ["Materials", "Steps", "Tests"]
    order = [field.name for field in HISTORY_FIELDS]
    for table in tables:
        places = [order.index(field["name"]) for field in table["fields"]]
        assert places == sorted(places)
    materials, steps, tests = tables
    items = [row["values"]["item"] for row in materials["rows"]]
    assert items == ["TPE", "PTFE", "adhesive"]
    assert [row["values"]["step"] for row in steps["rows"]] == [
        str(number + 1) for number in range(len(steps["rows"]))
    ]
    assert steps["rows"][0]["nominal"].startswith("135 °C, ")
    assert [row["values"]["step"] for row in tests["rows"]] == ["leak test", "proof test", "device"]


def test_lines_are_stored_with_their_photograph(client: Client, folder: Path) -> None:
    content = photograph()
    packed = base64.b64encode(content).decode()
    head = {"serial": "A1, A2", "date": "2026-05-04", "initials": "AL"}
    entries = [
        {**head, "item": "TPE", "lot": "L7", "expires": "2026-01-31"},
        {**head, "step": "1", "temperature_c": "134,5", "minutes": "20"},
        {**head, "step": "leak test", "decision": "accept", "photograph": packed},
    ]
    body = {"design": "two.toml", "entries": entries}
    answer = client.post("/api/record", json=body, headers=HEADERS).json()
    assert answer["entries"] == [f"e{n}" for n in range(1, 7)]
    assert answer["warnings"] == ["TPE lot L7 expired on 2026-01-31"]
    lab = Lab(folder / "lab.sqlite")
    stored = lab.contents().entries
    assert [entry.serial for entry in stored] == ["A1", "A2"] * 3
    assert stored[2].readings == {"temperature_c": 134.5, "minutes": 20.0}
    assert (folder / "lab-photographs" / stored[4].photograph).read_bytes() == content
    again = client.post("/api/record", json=body, headers=HEADERS)
    assert again.status_code == 422
    assert "A1 has this line already, entry e1" in again.json()["message"]
    assert len(lab.contents().entries) == 6


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ({"design": "two.toml", "entries": []}, "nothing is filled in"),
        ({"design": "two.toml", "entries": [{"serial": "A1"}]}, "an entry states a lot"),
        (
            {"design": "two.toml", "entries": [{"serial": "A1", "step": "1", "minutes": "long"}]},
            "1: minutes = 'long' must be a number",
        ),
        ({"design": "../two.toml", "entries": [{}]}, "is not a design file"),
        (
            {"design": "two.toml", "entries": [{"serial": "A1", "photograph": "/etc/passwd"}]},
            "arrived incomplete",
        ),
        (
            {"design": "two.toml", "entries": [{"serial": "A1", "photograph": "YWJj"}]},
            "is not a JPEG, PNG or WebP",
        ),
    ],
)
def test_what_cannot_be_stored_is_one_sentence(
    client: Client, folder: Path, body: dict[str, object], says: str
) -> None:
    answer = client.post("/api/record", json=body, headers=HEADERS)
    assert answer.status_code == 422
    assert says in answer.json()["message"]
    assert not (folder / "lab.sqlite").exists()


def test_a_phone_is_answered_the_record_page_alone(folder: Path) -> None:
    phone = Client(app(Studio(folder, TOKEN, address=PHONE)), base_url=f"http://{PHONE}:8417")
    assert phone.get("/record").status_code == 200
    assert phone.get("/api/record").status_code == 401
    assert phone.get("/api/record", headers=HEADERS).status_code == 200
    for path in ("/api/start", "/api/file/two.toml", "/api/template/1dof-5mm"):
        assert phone.get(path, headers=HEADERS).status_code == 404
    assert phone.post("/api/save", json={}, headers=HEADERS).status_code in (404, 405)
    other = {**HEADERS, "Host": "10.0.0.7:8417"}
    assert phone.get("/api/record", headers=other).status_code == 403
