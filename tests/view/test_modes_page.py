"""Modes that swing: a page of their own, in the report of a result, in the page of the view."""

from __future__ import annotations

import io
import json
import re
from html import unescape

import numpy as np
import pytest
from typer.testing import CliRunner

import hybrid
from hybrid.cli.commands import app
from hybrid.live.workers import Worker
from hybrid.view.report_parts import section

# Of two bending stiffnesses, or modes of one period could swing in any direction, along the line of sight as well.
SCENE = """
title: A rod between two clamps
environment: {gravity: 0}
cable: {sections: [{length: 10, mass: 5, diameter: 0.1, axial_stiffness: 1.0e+7, bending_stiffness: [500, 550], torsional_stiffness: 500}]}
ends:
  start: {kind: clamped, position: [0, 0, 0], tangent: [1, 0, 0], normal: [0, 0, 1]}
  end: {kind: clamped, position: [10.001, 0, 0], tangent: [1, 0, 0], normal: [0, 0, 1]}
initial: equilibrium
model: rod
mesh: {cells: 40}
time: {duration: 0.2, step: 0.1}
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    path = tmp_path_factory.mktemp("modes") / "scene.yaml"
    path.write_text(SCENE)
    return path, hybrid.modes(path, 20)


def pictures(page):
    return [json.loads(unescape(x)) for x in re.findall(r'data-mode="([^"]*)"', page)]


def test_pictures_have_the_shapes(found):
    """The drawn swing is the shape as it is seen, at rest where the clamps are; twist is drawn by ticks that turn."""
    _, modes = found
    drawn = pictures(section(modes))
    assert len(drawn) == len(modes.modes) == 20
    for mode, picture in zip(modes.modes, drawn, strict=True):
        rest, swing = np.array(picture["rest"][0]), np.array(picture["swing"][0])
        assert rest.min() >= 0.0 and np.abs(swing[[0, -1]]).max() == 0.0
        if mode.energy.get("twist", 0.0) > 0.5:
            turns = np.array(picture["ticks"])[:, -1]
            assert np.abs(turns).max() == pytest.approx(1.0, abs=0.05)
            x = (np.arange(len(turns)) / (len(turns) - 1)) * np.pi  # the lowest is half a wave
            if mode is next(m for m in modes.modes if m.energy.get("twist", 0.0) > 0.5):
                np.testing.assert_allclose(np.abs(turns), np.sin(x), atol=0.06)
        elif mode.what == "sideways" or "plane" in mode.what:
            assert not picture["ticks"] and np.ptp(swing[:, 1]) > 5.0
    assert any(x["ticks"] for x in drawn)


@pytest.mark.long
def test_a_page_of_their_own_and_in_the_report(found, tmp_path):
    scene, modes = found
    page = tmp_path / "modes.html"
    out = CliRunner().invoke(app, ["modes", str(scene), "--count", "12", "--plot", str(page)])
    assert out.exit_code == 0, out.output
    assert len(pictures(page.read_text())) == 12 and "Natural modes" in page.read_text()
    result = tmp_path / "run.h5"
    hybrid.run(scene, result).close()
    out = CliRunner().invoke(app, ["report", str(result), "--modes", "3", "-o", str(tmp_path / "run.html")])
    assert out.exit_code == 0, out.output
    text = (tmp_path / "run.html").read_text()
    assert len(pictures(text)) == 3 and 'href="#modes"' in text and f"{modes.modes[0].period:.4g} s" in text
    without = hybrid.report(hybrid.open(result), tmp_path / "without.html").read_text()
    assert 'id="modes"' not in without


def test_the_view_answers_with_the_page():
    told = io.StringIO()
    worker = Worker(told)
    worker.answer({"do": "modes", "text": SCENE, "file": ""})
    worker.answer({"do": "modes", "text": SCENE.replace("mass: 5", "mass: -5"), "file": ""})
    (first, made), (second, refused) = (line.split("\t", 1) for line in told.getvalue().splitlines())
    assert first == second == "modes" and len(pictures(json.loads(made)["html"])) == 10
    assert "mass" in json.loads(refused)["refused"]
