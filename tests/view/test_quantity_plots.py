"""Pictures of one quantity: what is drawn is what is in the file, on axes that the user composes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from reported import reported

import hybrid
from hybrid.cli.commands import main
from hybrid.errors import ResultError
from hybrid.view.figure import short

EXAMPLE = Path(__file__).parents[2] / "examples" / "01_hanging_chain.yaml"


def test_histories_profiles_and_single_values() -> None:
    result = reported()
    ax = hybrid.plot_quantity(result, "tension", at=[50.0, 100.0])
    lines = {line.get_label(): line.get_ydata() for line in ax.lines}
    assert lines["s = 50 m"] == pytest.approx(result.tension[:, 20] / 1000.0) and ax.get_ylabel() == "tension (kN)"
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["s = 50 m", "s = 100 m"]
    (line,) = hybrid.plot_quantity(result, "end_force_end").lines
    assert line.get_ydata() == pytest.approx(result["steps/end_force_end"] / 1000.0)
    profile = hybrid.plot_quantity(result, "tension").lines[0]
    assert profile.get_ydata() == pytest.approx(result.tension[-1] / 1000.0)
    (height,) = hybrid.plot_quantity(result, "z", at=50.0).lines
    assert height.get_ydata() == pytest.approx(result.position[:, 20, 2])
    with pytest.raises(ResultError, match="x, y or z"):
        hybrid.plot_quantity(result, "position", at=50.0)


def test_the_envelope_has_peaks_beyond_outputs(tmp_path: Path) -> None:
    """A chain that swings, saved at its turning points: its largest tension is between them, and in the picture."""
    scene = hybrid.load_scene(EXAMPLE, ["time.duration=0.84", "output.every=0.84"])
    result = hybrid.run(scene, tmp_path / "run.h5", progress=False)
    ax = hybrid.plot_quantity(result, "tension", envelope=True)
    high = next(line for line in ax.lines if line.get_label() == "highest")
    drawn = np.nanmax(high.get_ydata()) * (1000.0 if "kN" in ax.get_ylabel() else 1.0)
    assert drawn == pytest.approx(result["envelope/tension_max"].max())
    assert drawn > 1.01 * result.tension.max() and "every step" in ax.get_title(loc="left")


def test_a_spectrum_is_that_of_the_result() -> None:
    result = reported(outputs=401)
    (line,) = hybrid.plot_quantity(result, "tension", at=100.0, spectrum=True).lines
    found = result.spectrum("tension", at=100.0)
    shown = len(line.get_xdata())
    assert 2 < shown <= len(found.f) and line.get_xdata() == pytest.approx(found.f[:shown])
    unit = line.axes.get_ylabel()
    factor = {"N² s": 1.0, "kN² s": 1e-6}[unit[unit.index("(") + 1 : -1]]
    assert line.get_ydata() == pytest.approx(factor * np.ravel(found.S[:shown]))


def test_they_compose_on_axes_of_the_user() -> None:
    result = reported(outputs=21)
    figure = Figure(layout="constrained")
    axes = figure.subplots(2, 2).ravel()
    drawn = [
        hybrid.plot_shape(result, ax=axes[0]), hybrid.plot_quantity(result, "curvature", ax=axes[1]),
        hybrid.plot_zone_map(result, ax=axes[2]), hybrid.plot_energy(result, work=True, ax=axes[3]),
    ]  # fmt: skip
    assert all(one is given for one, given in zip(drawn, axes, strict=True)) and all(ax.has_data() for ax in axes)
    with pytest.raises(ResultError, match="no energies"):
        hybrid.plot_energy(reported(energy=False))
    with pytest.raises(ResultError, match="all times and places"):
        hybrid.plot_quantity(result, "tension", at=1.0, envelope=True)
    for name, text in (("tensoin", "did you mean tension"), ("end_force_end", "no value along the line")):
        with pytest.raises(ResultError, match=text):
            hybrid.plot_quantity(result, name, envelope=True)


def test_numbers_have_no_exponents() -> None:
    assert short(12345.0, 4) == "12340" and short(0.00012, 2) == "0.00012" and short(3.0, 4) == "3"


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    for arguments in (["static", str(EXAMPLE), "-o", "a.h5"], ["plot", "a.h5", "--quantity", "tension", "--envelope"]):
        with pytest.raises(SystemExit) as left:
            main([*arguments, "--quiet"])
        assert not left.value.code
    assert Path("a.tension.png").stat().st_size > 1000
    with pytest.raises(SystemExit) as left:
        main(["plot", "a.h5", "--quantity", "tensoin"])
    assert left.value.code == 1 and "tensoin" in capsys.readouterr().err
