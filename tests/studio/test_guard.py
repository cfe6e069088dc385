"""Who may ask the studio: token, Host, Origin, and no way out of the folder."""

from __future__ import annotations

import json
from pathlib import Path
from urllib.parse import quote

import pytest

from sbafab import api
from sbafab.actuators import FAMILIES
from sbafab.studio.app import Studio, app
from sbafab.studio.design_files import zipped
from tests.studio.asking import Client

TOKEN = "right-token"
BASE = "http://127.0.0.1:8417"
HEADERS = {"X-Sbafab-Token": TOKEN}


@pytest.fixture
def studio(tmp_path: Path) -> Studio:
    folder = tmp_path / "chosen"
    folder.mkdir()
    (folder / "own.toml").write_text(api.template("1dof-5mm"), encoding="utf-8")
    (tmp_path / "secret.toml").write_text('name = "secret"', encoding="utf-8")
    return Studio(folder, TOKEN, scratch=tmp_path / "scratch")


@pytest.fixture
def client(studio: Studio) -> Client:
    # Without its lifespan no process is started.
    return Client(app(studio), base_url=BASE)


def test_the_page_says_what_it_may_load(client: Client) -> None:
    answer = client.get("/")
    assert answer.status_code == 200
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "connect-src 'self'" in policy
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy


def test_nothing_is_told_without_the_token(client: Client) -> None:
    assert client.get("/api/start").status_code == 401
    assert client.get("/api/start", headers={"X-Sbafab-Token": "wrong"}).status_code == 401
    assert client.get(f"/api/start?token={TOKEN}").status_code == 401
    assert client.get("/api/start", headers=HEADERS).json()["files"] == ["own.toml"]


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example:8417", "", "10.0.0.7:8417"]
)
def test_a_name_bound_to_this_machine_is_refused(client: Client, host: str) -> None:
    assert client.get("/api/start", headers={**HEADERS, "Host": host}).status_code == 403
    assert client.get("/", headers={"Host": host}).status_code == 403


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:9999", "http://[", BASE + "/", ""]
)
def test_another_site_is_refused(client: Client, origin: str) -> None:
    headers = {**HEADERS, "Origin": origin}
    assert client.post("/api/live", json={"text": ""}, headers=headers).status_code == 403
    assert client.get("/api/start", headers={**HEADERS, "Origin": BASE}).status_code == 200


@pytest.mark.parametrize(
    "name",
    [
        "../secret.toml",
        "%2e%2e%2fsecret.toml",
        "/etc/passwd",
        "own.txt",
        "a\x00.toml",
        "..\\secret.toml",
    ],
)
def test_no_file_outside_is_read_or_written(client: Client, studio: Studio, name: str) -> None:
    assert client.get(f"/api/file/{quote(name, safe='')}", headers=HEADERS).status_code in {
        404,
        422,
    }
    body = {"name": name, "text": "gone"}
    answer = client.post("/api/save", json=body, headers=HEADERS)
    if answer.status_code == 200:  # on this system the name is a file's in the folder
        assert (studio.folder / name).resolve().parent == studio.folder.resolve()
    assert (studio.folder.parent / "secret.toml").read_text(encoding="utf-8") == 'name = "secret"'


@pytest.mark.parametrize("letters", ["a" * 236, "\u00e9" * 119, "a" * 300, "a" * 5000])
def test_a_name_too_long_for_a_file_is_one_sentence(client: Client, letters: str) -> None:
    """Systems take 255 bytes; what is saved has a longer name first."""
    name = f"{letters}.toml"
    shown = quote(name)
    answers = [
        client.post("/api/save", json={"name": name, "text": "# a"}, headers=HEADERS),
        client.get(f"/api/file/{shown}", headers=HEADERS),
        client.get(f"/api/watch/{shown}", headers=HEADERS),
        client.post("/api/record/sheet", json={"design": name}, headers=HEADERS),
    ]
    assert [answer.status_code for answer in answers] == [422] * len(answers)
    for answer in answers:
        told = answer.json()["message"]
        assert told.endswith(
            f"has {len(name.encode())} bytes; the limit for a design file is 240; shorten it"
        )
    longest = "a" * 235 + ".toml"
    saved = client.post("/api/save", json={"name": longest, "text": "# a"}, headers=HEADERS)
    assert saved.status_code == 200


def test_a_link_out_of_the_folder_is_not_followed(client: Client, studio: Studio) -> None:
    (studio.folder / "link.toml").symlink_to(studio.folder.parent / "secret.toml")
    assert client.get("/api/file/link.toml", headers=HEADERS).status_code == 422
    assert "link.toml" not in client.get("/api/start", headers=HEADERS).json()["files"]


def test_a_file_changed_meanwhile_is_not_saved_over(client: Client, studio: Studio) -> None:
    seen = client.get("/api/file/own.toml", headers=HEADERS).json()["sha"]
    (studio.folder / "own.toml").write_text("# theirs", encoding="utf-8")
    body = {"name": "own.toml", "text": "# mine", "seen": seen}
    refused = client.post("/api/save", json=body, headers=HEADERS)
    assert refused.status_code == 409
    assert "changed on disk" in refused.json()["message"]
    assert (studio.folder / "own.toml").read_text(encoding="utf-8") == "# theirs"
    over = client.post("/api/save", json={**body, "seen": None}, headers=HEADERS)
    assert over.status_code == 200
    assert (studio.folder / "own.toml").read_text(encoding="utf-8") == "# mine"


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"[]",
        b"{",
        b'{"text": 3}',
        b'{"text": "", "edits": [["a"]]}',
        b"[" * 5000,
        b'{"text": "", "edits": {"a": 1}}',
        b'{"text": "", "pose": 3}',
        b'{"text": "", "pose": [1]}',
    ],
)
def test_a_request_that_is_none_gets_one_sentence(client: Client, body: bytes) -> None:
    answer = client.post("/api/live", content=body, headers=HEADERS)
    assert answer.status_code == 422
    assert answer.json()["message"]


def test_what_was_made_needs_its_key_and_keeps_inside(client: Client, studio: Studio) -> None:
    folder = studio.scratch / "run" / "own"
    folder.mkdir(parents=True)
    (folder / "a.txt").write_text("a", encoding="utf-8")
    (studio.scratch / "run" / "b.txt").write_text("b", encoding="utf-8")
    studio.made["key"] = folder
    assert client.get("/made/key/a.txt").text == "a"
    assert "sandbox" in client.get("/made/key/a.txt").headers["content-security-policy"]
    assert client.get("/made/other/a.txt").status_code == 404
    assert client.get("/made/key/%2e%2e/b.txt").status_code == 404
    for name in ("a%00.txt", "a" * 5000, "%ED%A0%80"):
        assert client.get(f"/made/key/{name}").status_code == 404
    assert client.get("/made/key.zip").content == zipped(studio.made["key"])


def test_templates_and_forms_are_whole(client: Client) -> None:
    start = client.get("/api/start", headers=HEADERS).json()
    assert set(start["families"]) == set(FAMILIES)
    assert set(start["cards"]) == set(FAMILIES)
    for card in start["cards"].values():
        assert card["title"][0].isupper()
        assert card["symbol"].startswith("M")
        assert card["meaning"].endswith(".")
    assert list(start["summaries"]) == start["templates"]
    assert all(start["summaries"].values())
    lobed = {field["key"]: field for field in start["families"]["lobed"]}
    assert lobed["chamber.diameter"]["unit"] == "mm"
    assert lobed["press.temperature_c"]["unit"] == "\u00b0C"
    assert lobed["registration.method"]["choices"] == ["channel-pin", "ears"]
    assert all(field["meaning"] for field in lobed.values())
    text = client.get("/api/template/brace", headers=HEADERS).json()["text"]
    assert text == api.template("brace")
    assert client.get("/api/template/none", headers=HEADERS).status_code == 422
    json.dumps(start)
