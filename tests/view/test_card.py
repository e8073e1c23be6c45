"""What a notebook shows of a result: light, still, safe, and never an error."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest
from reported import reported

from hybrid.view.figure import KIND_COLOURS
from hybrid.view.notebook import picture


def test_a_result_shows_itself_with_facts_and_a_picture() -> None:
    shown = reported()._repr_html_()
    for words in ("Made-up mooring", "complete", "21 outputs", "Largest tension", "21 kN", "<svg", "On the seabed"):
        assert words in shown
    assert len(shown) < 40_000 and "<script" not in shown and "plotly" not in shown


def test_the_picture_shows_zones_in_their_colours() -> None:
    drawing = ElementTree.fromstring(picture(reported()))
    space = "{http://www.w3.org/2000/svg}"
    lines = [x.get("stroke") for x in drawing.iter(f"{space}path")]
    assert lines[-3:] == [KIND_COLOURS["catenary"], KIND_COLOURS["rod"], KIND_COLOURS["catenary"]]
    strips = {x.get("fill") for x in drawing.iter(f"{space}rect")}
    assert strips == {KIND_COLOURS["catenary"], KIND_COLOURS["rod"]}
    width, height = (float(x) for x in drawing.get("viewBox", "").split()[2:])
    assert all(float(x.get("x", 0)) + float(x.get("width", 0)) < width for x in drawing.iter(f"{space}rect"))
    assert all(float(x.get("y", 0)) < height for x in drawing.iter(f"{space}text"))


@pytest.mark.parametrize(
    "asked",
    [{"outputs": 0}, {"outputs": 1}, {"outputs": 2, "rod": False, "seabed": False, "energy": False}, {"points": 2}],
    ids=str,
)
def test_it_never_raises(asked: dict) -> None:
    result = reported(**asked)
    assert "Made-up mooring" in result._repr_html_()
    result.close()
    assert "Made-up mooring" in result._repr_html_()  # closed: what was read is there, or its name at least


def test_a_closed_result_shows_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    result = reported(title="<b>odd</b>")
    result.close()
    monkeypatch.setattr("hybrid.view.notebook.card", lambda result: 1 / 0)
    assert result._repr_html_().startswith("<pre>") and "<b>" not in result._repr_html_()
    monkeypatch.setattr(type(result), "__repr__", lambda self: str(1 / 0))
    assert "can no longer be read" in result._repr_html_()


def test_titles_are_escaped_and_failures_said() -> None:
    shown = reported(title="<script>x</script>", status="failed", message="it diverged\n  try: less")._repr_html_()
    assert "<script>" not in shown and "&lt;script&gt;" in shown and "failed: it diverged" in shown


def test_a_cell_of_a_long_run_is_small() -> None:
    assert len(reported(outputs=501)._repr_html_()) < 100e3
