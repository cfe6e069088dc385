"""The program from Python: changes in three ways, results in the types of other libraries."""

from __future__ import annotations

import json
import math
import re
import warnings
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely

import sbafab
from sbafab.errors import DesignError, OutputError
from sbafab.rules.finding import Finding, Findings, Place
from tests.importing.test_parchmint import circuit

SMALL = {"stack.balloons": 2, "rules": {"yield_builds": 100}}


def test_texts_dicts_and_keywords_say_the_same() -> None:
    by_text = sbafab.load("1dof-5mm", "stack.balloons=3", "chamber.diameter=[5, 6, 7]")
    by_dict = sbafab.load("1dof-5mm", {"stack.balloons": 3, "chamber": {"diameter": [5, 6, 7]}})
    by_name = sbafab.load("1dof-5mm", stack={"balloons": 3}, chamber={"diameter": (5, 6, 7)})
    assert by_text == by_dict == by_name
    assert by_text.with_("stack.balloons=3") == by_text


@pytest.mark.parametrize("number", [np.int64, np.uint8, np.float32, np.float64])
def test_numbers_of_numpy_are_numbers(number: type[np.number[Any]]) -> None:
    plain = sbafab.load("1dof-5mm", {"stack.balloons": 3, "chamber.diameter": [5, 6, 7]})
    few = sbafab.load("1dof-5mm", {"stack.balloons": np.int64(3)})
    sizes = {"chamber.diameter": np.array([5, 6, 7], number)}
    assert few.with_(sizes) == few.with_(chamber={"diameter": [number(d) for d in (5, 6, 7)]})
    assert few.with_(sizes) == plain
    assert sbafab.resolved(few.with_(sizes)) == sbafab.resolved(plain)
    with pytest.raises(DesignError, match=r"stack.balloons = 2.5 must be a whole number"):
        few.with_({"stack.balloons": np.float64(2.5)})


def test_options_of_numpy_are_plain_numbers(tmp_path: Path) -> None:
    options = {"flow_ml_min": np.float32(30), "volumes_ul": np.int64(5), "tip_load": 0.5}
    found = sbafab.predict("1dof-5mm", SMALL, quick=True, **options)  # type: ignore[arg-type]
    assert json.loads(json.dumps(found.as_dict()))["asked"]["flow_ml_min"] == 30
    wish = {"simulator": "sofa", "export": True, "pressure": np.float64(3.0)}
    for name, pressure in (("a", np.float64(3)), ("b", 3.0)):
        wish |= {"pressure": pressure, "out": tmp_path / name}
        sbafab.simulate("1dof-5mm", SMALL, **wish)  # type: ignore[arg-type]
    scenes = [sorted((tmp_path / name).rglob("*.scn")) for name in ("a", "b")]
    assert scenes[0]
    for one, other in zip(*scenes, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_with_keeps_the_rest_and_checks_like_a_design_file() -> None:
    design = sbafab.load("1dof-5mm", inlet={"tube_outer_diameter": 0.8})
    wide = design.with_(bond={"width": 0.9})
    assert (wide.bond.width, wide.inlet.tube_outer_diameter) == (0.9, 0.8)
    assert wide.inlet.width is None, "what follows from the tube stays open"
    assert wide.folder == design.folder
    with pytest.raises(DesignError, match=r"stack\.baloons .* did you mean stack\.balloons"):
        design.with_(stack={"baloons": 3})
    with pytest.raises(DesignError, match="family = 'lobed' must be \"1dof\""):
        design.with_(family="lobed")


def test_a_drawing_that_a_change_names_lies_where_the_user_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "o.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="9mm" height="9mm" viewBox="0 0 9 9">'
        '<circle r="3"/></svg>'
    )
    monkeypatch.chdir(tmp_path)
    design = sbafab.load("1dof-5mm").with_(chamber={"outline": "o.svg"})
    assert design.drawing == tmp_path / "o.svg"
    mask = sbafab.build(design).layer(6).profile
    assert mask.area == pytest.approx(math.pi * (3**2 - 0.52**2), rel=1e-6)


def test_regions_are_shapely_geometries_within_the_chord_error() -> None:
    plate = sbafab.build("3dof-15mm", SMALL).layer(3).profile
    length = sum(contour.length for contour in plate.contours)
    for error in (0.01, 0.001):
        shape = plate.shapely(error)
        assert shape.is_valid
        assert abs(shape.area - plate.area) < error * length
    assert shapely.geometry.shape(plate).equals(plate.shapely())


def test_layers_are_ezdxf_documents_of_the_same_area() -> None:
    layer = sbafab.build("1dof-5mm", SMALL).layer(5)
    circles = sbafab.drawing(layer).modelspace().query("CIRCLE")
    assert sorted(circle.dxf.radius for circle in circles) == pytest.approx([0.52, 3.25])


def test_solid_and_meshes_are_objects_of_other_libraries(tmp_path: Path) -> None:
    laminate = sbafab.build("1dof-5mm", SMALL)
    solid = sbafab.solid(laminate).trimesh()
    films = sum(layer.profile.area * layer.film.thickness for layer in laminate.tpe_layers)
    bonds = sum(gap.bond.area * gap.gap for gap in laminate.interfaces)
    assert solid.is_watertight
    assert solid.volume == pytest.approx(films + bonds, rel=1e-3)
    pyvista = pytest.importorskip("pyvista", reason="PyVista is not installed")
    run = sbafab.mesh("1dof-5mm", SMALL, h=0.7, formats=("vtu",), out=tmp_path)
    assert run.conforming is not None
    volume = run.conforming.volume
    grid = pyvista.read(run.folder / "mesh" / "volume.vtu")
    assert grid.n_cells == len(volume.cells)
    # Without gaps films lie on each other, and the volume is that of the films alone.
    assert abs(grid.compute_cell_sizes()["Volume"].sum()) == pytest.approx(films, rel=2e-3)
    assert set(grid.point_data) == {name for name in volume.node_sets if "bond_" not in name}


def test_findings_and_figures_are_rows() -> None:
    findings = sbafab.check("1dof-5mm", SMALL)
    table = findings.frame()
    assert list(table["rule"]) == [finding.rule for finding in findings]
    assert table.set_index("rule").loc["bond-width", "measured"] == 0.75
    assert (findings.failed, findings.ok, bool(findings)) == ((), True, True)
    bad = sbafab.check("1dof-5mm", SMALL, bond={"width": 0.7})
    assert "bond-width" in {finding.rule for finding in bad.failed}
    assert (bad.ok, bool(bad)) == (False, False)
    waived = sbafab.check("1dof-5mm", SMALL, bond={"width": 0.7}, rules={"waive": ["bond-width"]})
    assert waived.failed == tuple(f for f in bad.failed if f.rule != "bond-width")
    figures = sbafab.predict("1dof-5mm").frame()
    assert {"name", "value", "unit", "model"} <= set(figures.columns)


def test_a_measured_value_is_shown_as_what_it_is_compared_as() -> None:
    found = Finding("bond-width", "pass", 0.75, 0.7499999999, "mm", Place(), "")
    assert (found.measured, Findings((found,)).rows[0]["measured"]) == (0.75, 0.75)
    short = Finding("bond-width", "fail", 0.75, 0.748, "mm", Place(), "")
    assert short.measured == 0.748


def test_a_figure_is_asked_for_by_quantity_and_model() -> None:
    found = sbafab.predict("1dof-5mm")
    # The first model, Eq. 4, is the one to design with.
    assert found.value("largest_volume") == found.value("largest_volume", "eq-4")
    assert found.value("largest_volume", "eqs-1-to-3") == pytest.approx(16.95, abs=0.01)
    with pytest.raises(DesignError, match="did you mean reference_stroke"):
        found.value("referenc_stroke")
    with pytest.raises(DesignError, match=r"not one figure: there are .*by eq-4.*by eqs-1-to-3"):
        found.value("largest_volume", "lens")
    with pytest.raises(DesignError, match="not one figure: it is not predicted"):
        found.value("pull")


def test_one_pressure_is_a_number_or_a_list_and_no_text() -> None:
    one, several = (
        sbafab.predict("1dof-5mm", pressures_kpa=pressures, quick=True)
        for pressures in (np.float64(5), [5])
    )
    assert one.rows == several.rows
    with pytest.raises(DesignError, match="pressures_kpa = 'high' must be a number or a list"):
        sbafab.predict("1dof-5mm", pressures_kpa="high", quick=True)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("function", "keyword", "near"),
    [
        ("predict", "pressure_kpa", "pressures_kpa"),
        ("predict", "volume_ul", "volumes_ul"),
        ("stack", "pressure", "most_pressure"),
        ("mesh", "format", "formats"),
        ("simulate", "presure", "pressure"),
        ("find", "trials", "tries"),
        ("sweep", "sample", "samples"),
        ("generate", "outs", "out"),
    ],
)
def test_a_misspelt_argument_is_told_from_a_table_of_the_design(
    function: str, keyword: str, near: str
) -> None:
    wanted = {"simulate": {"simulator": "sofa"}, "sweep": {"vary": []}}.get(function, {})
    said = f"{keyword} is neither an argument of {function} nor a table .* did you mean {near}?"
    with pytest.raises(DesignError, match=said):
        getattr(sbafab, function)("1dof-5mm", **{keyword: 5}, **wanted)
    with pytest.raises(
        DesignError, match=r"pres is not a key of a design file; did you mean press"
    ):
        sbafab.predict("1dof-5mm", pres={"temperature_c": 150})


def test_cut_press_and_nest_write_their_parts(tmp_path: Path) -> None:
    run = sbafab.cut("1dof-5mm", SMALL, out=tmp_path, dxf_profile="arcs")
    assert sorted(path.name for path in (run.folder / "layers").iterdir())[0].startswith("001_TPE")
    assert not [finding for finding in sbafab.check_folder(run.folder) if finding.verdict == "fail"]
    assert (sbafab.press("1dof-5mm", SMALL, out=tmp_path).folder / "press.csv").is_file()
    designs = [sbafab.load(name, SMALL) for name in ("1dof-5mm", "1dof-10mm")]
    job = sbafab.nest(designs, "both", tmp_path)
    assert {path.name for path in job.folder.iterdir()} >= {"1dof-5mm", "1dof-10mm", "sheets"}


def test_simulate_exports_a_deck_and_refuses_what_is_no_key(tmp_path: Path) -> None:
    wish = {"simulator": "sofa", "export": True, "out": tmp_path}
    made = sbafab.simulate("1dof-5mm", stack={"balloons": 2}, pressure=3.0, **wish)
    assert made.folder is not None
    assert list(made.folder.glob("*.scn"))
    with pytest.raises(DesignError, match="presure"):
        sbafab.simulate("1dof-5mm", presure=3.0, **wish)


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        ({"simulator": "ccx"}, 'simulator = "ccx" must be one of calculix, sofa, mujoco'),
        ({"simulator": "sofa", "scene": "film"}, 'scene = "film" must be one of shell, frames'),
        ({"simulator": "calculix", "symmetry": "third"}, 'symmetry = "third" must be one of full'),
        ({"simulator": "calculix", "procedure": "slow"}, "must be one of dynamic, static"),
        ({"simulator": "calculix", "pressure": "6 kPa"}, "pressure = '6 kPa' must be a number"),
        ({"simulator": "mujoco", "minutes": 0}, "minutes = 0 must be a finite number above 0"),
        ({"simulator": "sofa", "h": 0.3}, "h is for calculix; omit it with sofa"),
    ],
)
def test_simulate_names_what_a_setting_may_be(
    tmp_path: Path, wish: dict[str, Any], words: str
) -> None:
    with pytest.raises(DesignError, match=re.escape(words)):
        sbafab.simulate("1dof-5mm", stack={"balloons": 2}, out=tmp_path / "out", **wish)
    assert list(tmp_path.iterdir()) == []


def test_notebooks_show_tables_and_pictures(tmp_path: Path) -> None:
    design = sbafab.load("1dof-5mm", SMALL)
    shown: dict[str, Any] = {
        "stack.balloons": design,
        "Stretchlon 200": sbafab.build(design),
        "bond-width": sbafab.check(design),
        "Eqs. 1-3": sbafab.predict(design),
        "press.json": sbafab.press(design, out=tmp_path),
    }
    for words, found in shown.items():
        page = found._repr_html_()
        ElementTree.fromstring(f"<div>{page.replace('&emsp;', ' ').replace('&ensp;', ' ')}</div>")
        assert len(repr(found)) < 100
        assert words in page


def test_a_laminate_is_imported_as_a_design(tmp_path: Path) -> None:
    pouch = sbafab.generate("pouch", out=tmp_path)
    source = pouch.folder / "laminate.json"
    with warnings.catch_warnings(record=True) as remarks:
        warnings.simplefilter("always")
        design = sbafab.import_design(source, tmp_path / "again.toml")
    assert design == sbafab.load(tmp_path / "again.toml")
    layers = [layer.profile for layer in sbafab.build("pouch").layers]
    assert [layer.profile for layer in sbafab.build(design).layers] == layers
    assert all(item.category is UserWarning for item in remarks)
    with pytest.raises(OutputError, match="already exists"):
        sbafab.import_design(source, tmp_path / "again.toml")
    with pytest.raises(DesignError, match="does not exist"):
        sbafab.import_design(tmp_path / "none")


def test_what_an_import_leaves_out_is_warned_of(tmp_path: Path) -> None:
    path = tmp_path / "circuit.json"
    path.write_text(json.dumps(circuit()), encoding="utf-8")
    with warnings.catch_warnings(record=True) as remarks:
        warnings.simplefilter("always")
        design = sbafab.import_design(path, tmp_path / "valves.toml")
    assert "layer electrodes: holds no channels; it is not imported" in [
        str(item.message) for item in remarks
    ]
    assert design.family == "drawn"
