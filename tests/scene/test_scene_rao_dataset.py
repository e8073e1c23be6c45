"""A vessel's response from a dataset of Capytaine in netCDF, its mean offset and its slow drift."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import extras
import numpy as np
import pytest

pytestmark = extras.of_file("xarray", "h5netcdf")

import xarray as xr
from test_scene_vessel import FAIRLEAD, HEADING, scene, table

import hybrid
from hybrid.model.build import build
from hybrid.scene.motion import read_rao
from hybrid.scene.read import one_line

DOFS = ["Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw"]
W = np.array([np.inf, 1.2, 0.3, 0.7, 2.0])  # as computed for added mass at infinity, in any order
DIRECTIONS = np.array([math.pi, 0.0, 0.5 * math.pi])


def parts(values: np.ndarray) -> Any:
    """As capytaine.io.xarray.separate_complex_values writes them."""
    return np.stack([values.real, values.imag])


def dataset(body: str = "") -> tuple[xr.Dataset, np.ndarray]:
    """A body of six degrees of freedom, coupled, and its response (F, H, 6) by a loop over the equation of motion."""
    draw = np.random.default_rng(7)
    square = draw.normal(size=(6, 6))
    M, K = np.diag([1e6, 1e6, 1e6, 3e7, 3e7, 3e7]), np.diag([0.0, 0.0, 2e6, 4e7, 6e7, 0.0])
    A = np.array([0.5 * M + 1e4 * (1 + k) * (square + square.T) for k in range(W.size)])
    B = np.array([2e5 * (np.eye(6) + 0.05 * square @ square.T) * (1 + k) for k in range(W.size)])
    FK, D = (1e5 * (draw.normal(size=(W.size, 3, 6)) + 1j * draw.normal(size=(W.size, 3, 6))) for _ in range(2))
    X = np.full((W.size, 3, 6), np.nan, complex)
    for i in range(1, W.size):
        for j in range(3):
            w = W[i]
            X[i, j] = np.linalg.solve(-(w**2) * (M + A[i]) - 1j * w * B[i] + K, FK[i, j] + D[i, j])
    names = [f"{body}{x}" for x in DOFS]
    pair, force = ("influenced_dof", "radiating_dof"), ("complex", "omega", "wave_direction", "influenced_dof")
    made = xr.Dataset(
        {
            "inertia_matrix": (pair, M), "hydrostatic_stiffness": (pair, K), "added_mass": (("omega", *pair), A),
            "radiation_damping": (("omega", *pair), B), "Froude_Krylov_force": (force, parts(FK)),
            "diffraction_force": (force, parts(D)),
        },
        {"omega": W, "wave_direction": DIRECTIONS, "radiating_dof": names, "influenced_dof": names,
         "complex": ["re", "im"]},
    )  # fmt: skip
    return made, X


@pytest.mark.parametrize("body", ["", "ship__"])
@pytest.mark.parametrize("solved", [False, True])
def test_the_response_is_that_of_the_equation_of_motion(tmp_path: Path, body: str, solved: bool) -> None:
    data, X = dataset(body)
    if solved:  # with the RAO itself in it
        data = xr.Dataset(
            {"rao": (("complex", "wave_direction", "omega", "radiating_dof"), parts(X.swapaxes(0, 1)))}, data.coords
        )
    data.to_netcdf(tmp_path / "ship.nc")
    w, headings, response = read_rao(str(tmp_path / "ship.nc"))
    assert w.tolist() == [0.3, 0.7, 1.2, 2.0]
    assert headings == pytest.approx([0.0, 90.0, 180.0])
    expected = X[[2, 3, 1, 4]][:, [1, 2, 0]]
    assert np.conj(response) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_damping_makes_it_lag() -> None:
    """Heave at resonance, excited in phase with the crest: it comes a quarter of a period later."""
    one = {"omega": [1.0], "wave_direction": [0.0], "radiating_dof": ["Heave"], "influenced_dof": ["Heave"]}
    pair = ("influenced_dof", "radiating_dof")
    data = xr.Dataset(
        {"mass": (pair, [[3.0]]), "added_mass": (("omega", *pair), [[[1.0]]]), "hydrostatic_stiffness": (pair, [[4.0]]),
         "radiation_damping": (("omega", *pair), [[[0.5]]]),
         "excitation_force": (("omega", "wave_direction", "influenced_dof"), [[[2.0]]])}, one,
    )  # fmt: skip
    from hybrid.scene.motion import _response

    _, _, X = _response(data, "x.nc")
    assert X[0, 0, 2] == pytest.approx(4.0 * np.exp(-0.5j * np.pi))  # F/(w B) = 4, 90 deg behind


def test_a_scene_moves_as_with_the_table_of_the_same_numbers(tmp_path: Path) -> None:
    def heave(w: float) -> float:
        return 1.0 / (1.0 + w * w)

    by_table = build(one_line(scene(table(tmp_path, {"heave": heave, "heave_phase": 30.0, "pitch": 1.5}))))
    w = np.linspace(0.05, 12.0, 600)
    rao = np.zeros((600, 2, 2), complex)  # Capytaine: Re(X exp(-i w t)), so a lag is a positive angle
    rao[:, :, 0] = (heave(w) * np.exp(1j * math.radians(30.0)))[:, None]
    rao[:, :, 1] = math.radians(1.5)
    data = xr.Dataset(
        {"rao": (("complex", "omega", "wave_direction", "radiating_dof"), parts(rao))},
        {"omega": w, "wave_direction": [0.0, math.pi], "radiating_dof": ["Heave", "Pitch"], "complex": ["re", "im"]},
    )
    data.to_netcdf(tmp_path / "ship.nc")
    made = scene(str(tmp_path / "ship.nc"))
    by_dataset = build(one_line(made))
    for t in (3.0, 20.0, 33.3):
        assert by_dataset.ends.at_time(t).position[1] == pytest.approx(by_table.ends.at_time(t).position[1], abs=1e-9)
    assert made.ends.named_files() == [str(tmp_path / "ship.nc")]


REFUSED: dict[str, tuple[Any, str]] = {
    "no coordinate": (lambda d: d.drop_vars("wave_direction"), "coordinates omega, wave_direction"),
    "no mass": (lambda d: d.drop_vars("inertia_matrix"), "inertia_matrix, or `rao`"),
    "no force": (lambda d: d.drop_vars("diffraction_force"), "diffraction_force, or `rao`"),
    "two bodies": (
        lambda d: d.assign_coords(radiating_dof=["a__Surge", "a__Sway", "a__Heave", "b__Roll", "b__Pitch", "b__Yaw"]),
        "degrees of freedom of one body",
    ),
    "a flexible mode": (lambda d: d.assign_coords(radiating_dof=[*DOFS[:5], "bending"]), "with bending"),
    "a hole": (lambda d: d.where(d.omega != 0.7), r"none at 0.7 rad/s"),
    "only infinity": (lambda d: d.isel(omega=[0]), "frequencies > 0"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_a_dataset_that_cannot_be_used_is_refused(tmp_path: Path, name: str) -> None:
    change, text = REFUSED[name]
    change(dataset()[0]).to_netcdf(tmp_path / "ship.nc")
    with pytest.raises(hybrid.SceneError, match=text):
        hybrid.run(scene(str(tmp_path / "ship.nc")))


def test_what_is_no_netcdf_is_refused(tmp_path: Path) -> None:
    (tmp_path / "ship.nc").write_text("frequency,heading,heave\n1,0,1\n")
    with pytest.raises(hybrid.SceneError, match="a netCDF file"):
        hybrid.run(scene(str(tmp_path / "ship.nc")))


def test_a_vessel_drifts_slowly_about_its_mean_place(tmp_path: Path) -> None:
    """In its own axes about its origin, beside its motion in waves: yaw carries the fairlead across, to first order."""
    drift = {"surge": {"amplitude": 3.0, "period": 120.0, "phase": 40.0},
             "yaw": [{"amplitude": 2.0, "period": 150.0}, {"amplitude": 0.5, "period": 80.0}]}  # fmt: skip
    rao = table(tmp_path, {"heave": 1.0})
    still, moved = (build(one_line(scene(rao, **more))) for more in ({}, {"drift": drift}))
    c, s, (x, y, _) = math.cos(math.radians(HEADING)), math.sin(math.radians(HEADING)), FAIRLEAD
    for t in (25.0, 39.0):  # after the ramp of the waves
        surge = 3.0 * math.sin(2 * math.pi * t / 120.0 + math.radians(40.0))
        yaw = math.radians(2.0 * math.sin(2 * math.pi * t / 150.0) + 0.5 * math.sin(2 * math.pi * t / 80.0))
        along, across = surge - yaw * y, yaw * x
        wanted = [c * along - s * across, s * along + c * across, 0.0]
        assert moved.ends.at_time(t).position[1] - still.ends.at_time(t).position[1] == pytest.approx(wanted, abs=1e-9)
    assert moved.ends.at_time(0.0).position[1] == pytest.approx(still.ends.at_time(0.0).position[1])
    with hybrid.run(scene(rao, drift=drift)) as result:
        assert result.position[50, -1] == pytest.approx(moved.ends.at_time(float(result.t[50])).position[1], abs=1e-8)


def test_a_drift_too_fast_for_the_step_is_refused(tmp_path: Path) -> None:
    with pytest.raises(hybrid.SceneError, match=r"vessel\.drift\.heave"):
        hybrid.run(scene(table(tmp_path, {"heave": 1.0}), drift={"heave": {"amplitude": 1.0, "period": 0.2}}))
