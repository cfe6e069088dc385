"""What the site is made of, without building it: references, gallery, links, examples."""

from __future__ import annotations

import re
import runpy
from importlib import import_module
from pathlib import Path

import pytest

import sbafab
from docs.scripts import reference_cli, reference_keys
from docs.scripts.offline import complaints
from docs.scripts.rule_pictures import OTHERS, pair
from sbafab.api.explained import design_keys
from sbafab.cli import COMMANDS
from tests.rules.test_deck import TESTED_APART

ROOT = Path(__file__).parents[2]
LINK = re.compile(r"\]\((?!https?://|#|mailto:)([^)#\s]+)")


def test_the_page_of_commands_has_every_command_and_option() -> None:
    page = reference_cli.page()
    for command in COMMANDS.values():
        assert f"## sbafab {command.name}\n" in page
        for param in command.params:
            if param.param_type_name == "option":
                assert param.opts[-1] in page, param.opts


def test_the_page_of_keys_has_every_key() -> None:
    page = reference_keys.page()
    assert [row.key for row in design_keys() if f"`{row.key}`" not in page] == []


@pytest.mark.parametrize(
    "path", sorted((ROOT / "docs" / "scripts").glob("*.py")), ids=lambda path: path.stem
)
def test_what_makes_the_pages_finds_what_it_uses(path: Path) -> None:
    try:
        import_module(f"docs.scripts.{path.stem}")
    except ModuleNotFoundError as missing:
        if str(missing.name).split(".")[0] in {"sbafab", "docs", "tests"}:
            raise
        pytest.skip(f"{missing.name} is not installed")


def test_every_rule_has_its_picture() -> None:
    assert OTHERS.keys() == TESTED_APART
    for rule in ("film-limits", "press-fit"):
        drawn = pair(rule)
        assert drawn.right != drawn.wrong
        assert drawn.wrong.count("<circle") == 1


def test_links_between_the_pages_of_the_source_lead_somewhere() -> None:
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "docs").glob("[lr]*/*.md")]
    assert len(pages) > 20
    lost = [
        f"{page.relative_to(ROOT)}: {path}"
        for page in pages
        for path in LINK.findall(page.read_text(encoding="utf-8"))
        if not (page.parent / path).exists()
    ]
    assert lost == []


def test_no_page_takes_the_name_of_one_that_sphinx_writes() -> None:
    own = {"search", "genindex", "modindex", "py-modindex"}
    assert not own & {page.stem for page in (ROOT / "docs").glob("*.md")}


def test_a_site_that_asks_another_host_or_leads_nowhere_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(
        '<p id="x"></p><a href="b.html#y">b</a><a href="https://example.org">away</a>'
        '<a href="c.html">c</a><script src="https://example.org/x.js"></script>'
    )
    (tmp_path / "b.html").write_text('<a href="a.html#x">a</a>')
    (tmp_path / "a.css").write_text("p { background: url(//example.org/x.png) }")
    assert list(complaints(tmp_path)) == [
        "a.html loads https://example.org/x.js from another host",
        "a.html leads to b.html#y: no 'y' in it",
        "a.html leads to c.html: no such file",
        "a.css loads from another host",
    ]


@pytest.mark.long
def test_the_examples_for_assistants_pass(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "llms.txt").read_text(encoding="utf-8")
    examples = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    assert len(examples) == 3
    for number, example in enumerate(examples):
        path = tmp_path / f"{number}.toml"
        path.write_text(example)
        assert sbafab.check(path).failed == ()


def test_readme_is_short_and_begins_with_its_two_commands() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 120
    (block, *_) = re.findall(r"^```\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert block.splitlines() == [
        "python -m pip install . && sbafab generate 3dof-15mm",
        'python -m pip install -e ".[dev]" && python -m tests',
    ]


def test_readme_is_published_with_absolute_links() -> None:
    hook = runpy.run_path(str(ROOT / ".ci" / "metadata.py"))
    text = "![a](docs/images/x.png) [b](docs/y.md) [c](https://d.org/z) [e](#f)"
    assert hook["absolute"](text, "https://h.org/o/p") == (
        "![a](https://h.org/o/p/raw/main/docs/images/x.png) "
        "[b](https://h.org/o/p/blob/main/docs/y.md) [c](https://d.org/z) [e](#f)"
    )
    assert hook["urls"]("") == {}


TITLE = "A Collapsible Soft Actuator Facilitates Performance in Constrained Environments"
NAMES = "Rogatinsky Gomatam Lim Lee Kinnicutt Duriez Thomson McDonald Ranzani"
DOCS = sorted((ROOT / "docs").glob("*.md")) + sorted((ROOT / "docs" / "learn").glob("*.md"))


@pytest.mark.parametrize("files", [[ROOT / "README.md"], DOCS], ids=["readme", "docs"])
def test_a_text_cites_the_paper_once(files: list[Path]) -> None:
    """As published, doi.org/10.1002/aisy.202200085."""
    text = " ".join(" ".join(path.read_text(encoding="utf-8").split()) for path in files)
    text = text.replace("> ", "")
    for words in (TITLE, "Advanced Intelligent Systems", "doi.org/10.1002/aisy.202200085"):
        assert text.count(words) == 1
    before = text[: text.index(TITLE)][-150:]
    places = [before.index(f" {name}") for name in NAMES.split()]
    assert places == sorted(places)


def test_the_citation_file_cites_the_paper_once() -> None:
    # Read as lines: YAML would take a package for this one file.
    program, paper = (ROOT / "CITATION.cff").read_text(encoding="utf-8").split("references:\n")
    assert "cite it, and the paper" in program
    assert paper.count("- type: article") == 1
    doi, journal = "10.1002/aisy.202200085", "Advanced Intelligent Systems"
    for key, value in (("title", TITLE), ("journal", journal), ("doi", doi), ("year", "2022")):
        assert re.findall(rf"^    {key}: (.*)$", paper, re.MULTILINE) == [value]
    assert re.findall(r"^        family-names: (.*)$", paper, re.MULTILINE) == NAMES.split()
    given = re.findall(r"^      - given-names: \S", paper, re.MULTILINE)
    assert len(given) == len(NAMES.split())
