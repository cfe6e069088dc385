"""The studio as a folder of files: it is whole, and Python answers in it as the server does."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
import zipfile
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from sbafab import api
from sbafab.cli.studio import studio
from sbafab.errors import DesignError, OutputError
from sbafab.studio import in_page, without_server
from sbafab.studio.app import Studio, app
from tests.studio.asking import Client
from tests.studio.worked import answers, job

SMALL = api.template("1dof-5mm").replace("balloons = 6", "balloons = 2") + (
    "[rules]\nyield_builds = 100\n"
)
ABI = "cp314-cp314-pyemscripten_2026_0_wasm32"
CORE = metadata.version("pydantic-core")


def asked(path: str, **body: Any) -> list[dict[str, Any]]:
    return [json.loads(line) for line in in_page.answers(path, json.dumps(body))]


@pytest.fixture
def memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in place of the page's memory."""
    monkeypatch.setattr(in_page, "FOLDER", tmp_path / "studio")
    monkeypatch.setattr(in_page, "OUT", tmp_path / "studio" / "out")
    return tmp_path


@pytest.fixture
def pyodide(tmp_path: Path) -> Path:
    """A folder that looks like Pyodide's, with pydantic's core for it."""
    folder = tmp_path / "pyodide"
    folder.mkdir()
    for name in (*without_server.NEEDED, without_server.EITHER[0]):
        (folder / name).write_bytes(name.encode())
    lock = {"info": {"python": "3.14.2", "abi_version": "2026_0"}}
    (folder / "pyodide-lock.json").write_text(json.dumps(lock), encoding="utf-8")
    (folder / f"pydantic_core-{CORE}-{ABI}.whl").write_bytes(b"core")
    return folder


# What Python in the page answers.


def test_the_page_begins_as_a_served_one(memory: Path) -> None:
    client = Client(app(Studio(memory, "t", scratch=memory)), "http://127.0.0.1:1")
    served = client.get("/api/start", headers={"X-Sbafab-Token": "t"}).json()
    (own,) = asked("/api/start")
    assert {**own, "folder": str(memory)} == {**served, "lacks": []}
    (text,) = asked("/api/template/1dof-5mm")
    assert text == {"text": api.template("1dof-5mm")}


def test_the_page_answers_as_a_worker_does(memory: Path) -> None:
    edits = [["chamber.diameter", "5.5"]]
    own = asked("/api/live", text=SMALL, edits=edits, tab="a", has=[])
    theirs = answers({**job(memory, SMALL), "edits": edits})
    assert own == json.loads(json.dumps(theirs))


def test_what_is_cut_in_the_page_is_what_the_command_cuts(memory: Path) -> None:
    text = SMALL.replace("[rules]", '[registration]\nmethod = "ears"\n[rules]')
    (made,) = (a for a in asked("/api/generate", text=text) if a["kind"] == "made")
    content = in_page.made_bytes(f"/made/{made['key']}.zip")
    assert content is not None
    archive = zipfile.ZipFile(io.BytesIO(content))
    run = api.cut(api.loads(text), out=memory / "theirs")
    paths = [path for path in run.folder.rglob("*") if path.is_file()]
    assert {name: archive.read(name) for name in archive.namelist()} == {
        f"{made['name']}/{path.relative_to(run.folder).as_posix()}": path.read_bytes()
        for path in paths
    }
    first = next(name for name in made["files"] if name.startswith("layers/"))
    assert in_page.made_bytes(f"/made/{made['key']}/{first}") == (run.folder / first).read_bytes()
    for wrong in ("/made/none.zip", f"/made/{made['key']}/../../x", f"/made/{made['key']}/none"):
        assert in_page.made_bytes(wrong) is None


def test_a_design_that_breaks_a_rule_is_not_cut_in_the_page(memory: Path) -> None:
    made = asked("/api/generate", text=SMALL, edits=[["bond.width", "0.4"]])[-1]
    assert made["failed"]
    assert not [name for name in made["files"] if name.endswith(".dxf")]


def test_bad_requests_get_one_sentence(memory: Path) -> None:
    (told,) = asked("/api/live", text=SMALL, edits=[["bond.width", '"5 ft"']])[-1:]
    assert told["kind"] == "error"
    assert told["field"] == "bond.width"
    assert asked("/api/save", name="x.toml", text="")[0]["kind"] == "error"
    (line,) = in_page.answers("/api/live", "[]")
    assert "not a table" in json.loads(line)["message"]
    brace = api.template("brace")
    assert "assembly" in asked("/api/generate", text=brace)[-1]["message"]


BLOCKED = """
import json, sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {blocked}:
            raise ModuleNotFoundError(name, name=name)

sys.meta_path.insert(0, Missing())
from pathlib import Path
from sbafab.studio import in_page
in_page.FOLDER, in_page.OUT = Path({folder!r}), Path({folder!r}) / "out"
for path in ("/api/live", "/api/generate"):
    for line in in_page.answers(path, json.dumps({{"text": {text!r}}})):
        told = json.loads(line)
        print(path, told["kind"], told.get("rule", ""), told.get("message", ""))
"""


def test_without_numpy_all_but_registration_is_measured_and_nothing_is_cut(memory: Path) -> None:
    """Of packages that are no Python, the page's Python may have pydantic's core alone."""
    blocked = {"numpy", "shapely", "PIL", "matplotlib", "manifold3d", "ezdxf", "rich", "click"}
    blocked |= {"starlette", "uvicorn", "multiprocessing", "jinja2"}
    program = BLOCKED.format(blocked=blocked, folder=str(memory / "in"), text=SMALL)
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    lines = [line.split(" ", 3) for line in done.stdout.splitlines()]
    rules = [rule for path, kind, rule, _ in lines if (path, kind) == ("/api/live", "rule")]
    counted = ("registration-worst-case", "registration-yield")
    assert rules == [rule for rule, _ in api.checking(api.loads(SMALL)) if rule not in counted]
    assert [kind for path, kind, *_ in lines if path == "/api/live"][-3:] == [
        "unmeasured",
        "nets",
        "checked",
    ]
    for kind in ("unpredicted", "error"):
        told = next(line for line in lines if line[1] == kind)
        assert "needs numpy" in told[3]
    assert not list(memory.rglob("*.dxf"))


# The folder.


def test_the_folder_is_whole(pyodide: Path, tmp_path: Path) -> None:
    page = without_server.write(tmp_path / "site", pyodide)
    assert page.lacks == ("numpy",)
    names = {p.relative_to(page.folder).as_posix() for p in page.folder.rglob("*") if p.is_file()}
    static = without_server.STATIC
    assert {p.relative_to(static).as_posix() for p in static.rglob("*") if p.is_file()} < names
    own = page.folder / "python"
    listing = json.loads((own / "python.json").read_text(encoding="utf-8"))
    for name in (*listing["archives"], *listing["wheels"], *without_server.NEEDED):
        assert f"python/{name}" in names
    index = (page.folder / "index.html").read_text(encoding="utf-8")
    assert "sbafab-without-server" in index
    # What the page loads lies in the folder, and its policy lets it ask nobody else.
    for link in re.findall(r'(?:src|href)="([^"#]+)"', index):
        assert link in names
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', index)
    assert policy is not None
    assert policy[1].startswith("default-src 'none'")
    assert not re.search(r"https?:|\*", policy[1])


@pytest.mark.long
def test_python_in_the_folder_runs_by_itself(pyodide: Path, tmp_path: Path) -> None:
    """Program and packages of the folder, with nothing installed but pydantic's core and numpy."""
    site = without_server.write(tmp_path / "site", pyodide).folder
    own = tmp_path / "packages"
    for name in ("sbafab.zip", "packages.zip"):
        zipfile.ZipFile(site / "python" / name).extractall(own)
    for name in ("numpy", "pydantic_core"):
        found = find_spec(name)
        assert found is not None
        assert found.origin is not None
        (own / name).symlink_to(Path(found.origin).parent)
    program = (
        f"import sys; sys.path.insert(0, {str(own)!r})\n"
        "from pathlib import Path\nimport json, sbafab\nfrom sbafab.studio import in_page\n"
        f"in_page.FOLDER = Path({str(tmp_path / 'in')!r}); in_page.OUT = in_page.FOLDER / 'out'\n"
        f"lines = in_page.answers('/api/generate', json.dumps({{'text': {SMALL!r}}}))\n"
        "print(sbafab.__file__, json.loads(list(lines)[-1])['kind'])\n"
    )
    command = [sys.executable, "-S", "-I", "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(own / "sbafab" / "__init__.py"), "made"]


def test_equal_input_gives_equal_bytes_and_the_folder_is_replaced(
    pyodide: Path, tmp_path: Path
) -> None:
    (pyodide / f"numpy-2.4.6-{ABI}.whl").write_bytes(b"numpy")
    contents = []
    for _ in range(2):
        page = without_server.write(tmp_path / "site", pyodide)
        assert page.lacks == ()
        contents.append({p: p.read_bytes() for p in page.folder.rglob("*") if p.is_file()})
        # What an earlier version wrote, and listed, goes.
        (page.folder / "left-over.js").write_text("", encoding="utf-8")
        listing = page.folder / without_server.LISTING
        listed = json.loads(listing.read_text(encoding="utf-8"))
        listed["files"].append("left-over.js")
        listing.write_text(json.dumps(listed), encoding="utf-8")
    assert contents[0] == contents[1]


def test_what_is_missing_is_said_with_what_adds_it(pyodide: Path, tmp_path: Path) -> None:
    core = pyodide / f"pydantic_core-{CORE}-{ABI}.whl"
    # For another Python, or of a version that pydantic refuses.
    for other in (
        f"pydantic_core-{CORE}-cp313-cp313-pyodide_2025_0_wasm32.whl",
        f"pydantic_core-2.0.0-{ABI}.whl",
    ):
        core = core.rename(pyodide / other)
        with pytest.raises(DesignError, match=f"pip download .* pydantic-core=={CORE}"):
            without_server.write(tmp_path / "site", pyodide)
    (pyodide / "pyodide-lock.json").write_text("{}", encoding="utf-8")
    with pytest.raises(DesignError, match="does not say for which Python"):
        without_server.write(tmp_path / "site", pyodide)
    (pyodide / "pyodide.asm.wasm").unlink()
    with pytest.raises(DesignError, match=r"pyodide.asm.wasm is missing.*npm pack pyodide"):
        without_server.write(tmp_path / "site", pyodide)
    assert not (tmp_path / "site").exists()


def test_pydantic_of_the_distribution_is_taken_with_its_own_core(
    pyodide: Path, tmp_path: Path
) -> None:
    (pyodide / f"pydantic_core-{CORE}-{ABI}.whl").rename(
        pyodide / f"pydantic_core-2.41.5-{ABI}.whl"
    )
    with zipfile.ZipFile(pyodide / "pydantic-2.12.5-py3-none-any.whl", "w") as archive:
        archive.writestr(
            "pydantic-2.12.5.dist-info/METADATA", "Requires-Dist: pydantic-core==2.41.5\n"
        )
    own = without_server.write(tmp_path / "site", pyodide).folder / "python"
    listing = json.loads((own / "python.json").read_text(encoding="utf-8"))
    assert listing["wheels"] == [
        f"pydantic_core-2.41.5-{ABI}.whl",
        "pydantic-2.12.5-py3-none-any.whl",
    ]
    names = zipfile.ZipFile(own / "packages.zip").namelist()
    assert not [name for name in names if name.startswith("pydantic/")]
    assert "tomlkit/__init__.py" in names


def test_the_command_says_what_was_written_and_what_it_goes_without(
    pyodide: Path, tmp_path: Path
) -> None:
    site = str(tmp_path / "site")
    done = CliRunner().invoke(studio, ["--static", site, "--pyodide", str(pyodide)])
    assert done.exit_code == 0
    assert f"python -m http.server --bind 127.0.0.1 --directory {site}" in done.output
    assert "Without numpy the page has no prediction" in done.output
    for wrong in (["3dof-15mm", "--static", site], ["--pyodide", str(pyodide)]):
        assert CliRunner().invoke(studio, wrong).exit_code == 2


def test_a_folder_of_something_else_is_left_alone(pyodide: Path, tmp_path: Path) -> None:
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "thesis.txt").write_text("x", encoding="utf-8")
    with pytest.raises(OutputError, match=r"holds thesis\.txt, which the page did not write"):
        without_server.write(tmp_path / "site", pyodide)
    assert os.listdir(tmp_path / "site") == ["thesis.txt"]
    file = tmp_path / "page"
    file.write_text("x", encoding="utf-8")
    with pytest.raises(OutputError, match="is a file or a link"):
        without_server.write(file, pyodide)
    assert file.read_text(encoding="utf-8") == "x"
    assert sorted(os.listdir(tmp_path)) == ["page", "pyodide", "site"]


def test_what_was_put_into_the_page_since_is_not_lost(pyodide: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    without_server.write(site, pyodide)
    own = site / ".git" / "config"
    own.parent.mkdir()
    own.write_text("x", encoding="utf-8")
    with pytest.raises(OutputError, match=r"holds \.git/config, which the page did not write"):
        without_server.write(site, pyodide)
    assert own.read_text(encoding="utf-8") == "x"
