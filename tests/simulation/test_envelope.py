"""The envelope: extremes of every accepted step at every node, whatever is written down between."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

import hybrid

SCENE = """
title: A line with a float, two sections, on a seabed
environment: {fluid: {density: 1025}, seabed: {z: -20, stiffness: 3.0e+3, damping: 2.0e+2}}
cable:
  sections:
    - {length: 24, mass: 2, diameter: 0.03, axial_stiffness: 1.0e+6, bending_stiffness: 20, drag: {normal: 1.2}}
    - {length: 16, mass: 3, diameter: 0.04, axial_stiffness: 2.0e+6, bending_stiffness: 80, drag: {normal: 1.2}}
  attachments: [{kind: float, at: 32, buoyancy: 150, mass: 3}]
ends:
  start: {kind: pinned, position: [0, 0, -20]}
  end: {kind: clamped, position: [30, 0, 0], tangent: [0.2, 0, 1], motion: {heave: {amplitude: 0.8, period: 3}, ramp: 3}}
initial: equilibrium
model: rod
mesh: {cells: 40}
time: {duration: 4, step: 0.02}
output: {every: 0.02, exact: true, points: 41}
"""


def scene(*settings: str) -> hybrid.Scene:
    return hybrid.parse_scene(SCENE, overrides=settings)


@pytest.mark.parametrize(
    "settings",
    [
        (),
        ("dimension=3",),
        (
            "model=catenary",
            "ends.end={kind: pinned, position: [30, 0, 0], motion: {heave: {amplitude: 0.2, period: 3}, ramp: 3}}",
        ),
        ("model={zones: [{rod: 12}, {catenary: 28}]}", "ends.end={kind: free, force: [500, 0, 900]}"),
    ],
)
@pytest.mark.long  # 3 s of 4 cases
def test_it_is_what_outputs_at_every_step_and_node_show(settings: tuple[str, ...]) -> None:
    """Interpolation of tension, one-sided values at loads and sections, chords of catenaries: the rules of outputs."""
    result = hybrid.run(scene(*settings))
    assert len(result.times) == len(result["steps/t"]) + 1 == 201
    envelope, places = result["envelope"], result["envelope/s"]
    for name in ("tension", "curvature", "bending_moment", "contact"):
        if name not in result:
            assert f"{name}_max" not in envelope
            continue
        s, values = result.both_sides(name)
        kept = np.isin(s, places) & ~((s == 12.0) & (len(settings) > 1 and "zones" in settings[0]))  # a joint is one
        s, values = s[kept], values[:, kept]
        columns = np.searchsorted(places, s) + np.append(False, s[1:] == s[:-1])
        assert len(s) >= 40
        loads = np.isin(s, [24.0, 32.0]) & (name == "bending_moment")  # outputs project it on a tangent of one side
        for bound, extreme in (("min", values.min(axis=0)), ("max", values.max(axis=0))):
            found = envelope[f"{name}_{bound}"][columns]
            wrong = np.abs(found - extreme)[~loads].max()
            assert wrong <= 1e-9 * np.abs(values).max(), (name, bound)
            at = envelope[f"{name}_t_{bound}"][columns]
            rows = np.rint(at / 0.02).astype(int)
            shown = values[rows, np.arange(len(s))]
            assert np.abs(shown - found)[~loads].max() <= 1e-9 * np.abs(values).max(), (name, bound)
    position = result.position
    moved = np.linalg.norm(position - position[0], axis=2).max(axis=0)
    columns = np.searchsorted(places, result.s[np.isin(result.s, places)])
    assert np.allclose(envelope["displacement_max"][columns], moved[np.isin(result.s, places)], atol=1e-9)
    assert float(result["envelope/begin"]) == 0.0 and float(result["envelope/end"]) == 4.0


def test_it_does_not_depend_on_outputs() -> None:
    many, few = (hybrid.run(scene("output.exact=false", f"output.every={x}")) for x in (0.02, 2.0))
    for name in many["envelope"]:
        assert many[f"envelope/{name}"].tobytes() == few[f"envelope/{name}"].tobytes(), name
    assert few.tension.max() < 0.99 * few["envelope/tension_max"].max()  # the outputs alone miss it


ADAPTIVE = ("model={kind: adaptive, tolerance: 1.0e-4}", "mesh={cells: 20}", "output={every: 0.5}", "time.duration=8")


@pytest.mark.long
def test_zones_that_change_leave_it_on_the_finest_mesh_and_above_all_outputs() -> None:
    result = hybrid.run(scene(*ADAPTIVE, "output={every: 0.02, exact: true}"))
    assert len({tuple(zones) for zones in result.zones}) > 1
    envelope, s = result["envelope"], result["envelope/s"]
    assert all(np.isfinite(envelope[name]).all() for name in envelope)
    assert (np.diff(s) >= 0.0).all() and np.count_nonzero(np.diff(s) == 0.0) == 2
    for name in ("tension", "curvature", "contact"):
        highest = result.both_sides(name)[1].max()
        points_between_nodes = 0.95 if name == "contact" else 1 - 1e-9
        assert highest * points_between_nodes <= envelope[f"{name}_max"].max() <= 1.3 * highest, name
    lowest = result.both_sides("tension")[1].min()  # in the middle of a cell
    assert envelope["tension_min"].min() <= lowest + 0.01 * abs(lowest)


LIMITS = (
    "cable.sections[0].min_bend_radius=5", "cable.sections[1].max_tension=1000", "cable.sections[0].min_tension=0",
    "output={every: 2}",
)  # fmt: skip


def test_limits_are_judged_by_every_step() -> None:
    result = hybrid.run(scene(*LIMITS))
    events = {event.kind: event for event in result.events}
    bend, pull = events["bend radius below limit"], events["tension above limit"]
    envelope, s = result["envelope"], result["envelope/s"]
    first = int(np.searchsorted(s, 24.0, side="left")) + 1
    k = int(envelope["curvature_max"][:first].argmax())
    assert bend.value == pytest.approx(1.0 / envelope["curvature_max"][k]) and bend.threshold == 5.0
    assert (bend.s_a, bend.t) == (s[k], envelope["curvature_t_max"][k]) and "below the 5 m allowed" in bend.text
    assert pull.value == envelope["tension_max"][first:].max() and pull.threshold == 1000.0
    assert np.isnan(result["envelope/max_tension"][:first]).all()
    assert (result["envelope/max_tension"][first:] == 1000.0).all()
    free = hybrid.run(scene(LIMITS[-1]))
    assert "envelope/max_tension" not in free and np.array_equal(free.tension, result.tension)
    assert not {"tension below limit", "bend radius below limit"} & {event.kind for event in free.events}


def test_an_equilibrium_has_that_of_its_one_state_at_every_node() -> None:
    coarse, fine = (
        hybrid.static(scene("mesh={cells: 400}", f"output={{points: {n}}}", "cable.sections[0].min_bend_radius=50"))
        for n in (21, 401)
    )
    assert coarse["envelope/curvature_max"].tobytes() == fine["envelope/curvature_max"].tobytes()
    assert (fine["envelope/curvature_t_max"] == 0.0).all() and "displacement_max" not in fine["envelope"]
    assert fine["envelope/curvature_max"].max() == pytest.approx(fine.both_sides("curvature")[1].max(), rel=1e-9)
    a, b = ([e for e in x.events if e.kind == "bend radius below limit"] for x in (coarse, fine))
    assert a == b and len(a) == 1
    assert coarse.curvature[:, coarse.s < 24.0].max() < 0.99 / a[0].value  # the outputs alone miss it


def test_limits_that_leave_no_room_are_refused() -> None:
    with pytest.raises(hybrid.SceneError, match="below max_tension"):
        scene("cable.sections[0].max_tension=10", "cable.sections[0].min_tension=20")


@pytest.mark.needs("xarray", "h5netcdf")
def test_it_is_exported(tmp_path: Path) -> None:
    result = hybrid.run(scene("output={every: 2}", "time.duration=0.5"))
    hybrid.export(result, tmp_path / "e.csv", names=["envelope"])
    lines = (tmp_path / "e.csv").read_text().splitlines()
    assert any("all accepted steps, t = 0 to 0.5 s" in line for line in lines if line.startswith("#"))
    table = [line.split(",") for line in lines if not line.startswith("#")]
    column = table[0].index("envelope/tension_max (N)")
    assert table[0][0] == "s (m)"
    assert np.array_equal([float(row[column]) for row in table[1:]], result["envelope/tension_max"])
    data = result.to_xarray()
    assert data.envelope_tension_max.dims == ("envelope_s",)
    assert float(data.envelope_tension_max.max()) == result["envelope/tension_max"].max()


def test_a_file_of_0_6_goes_on_with_one_that_begins_there(tmp_path: Path) -> None:
    path = tmp_path / "older.h5"
    path.write_bytes(gzip.decompress((Path(__file__).parents[1] / "data" / "result_0.6.h5.gz").read_bytes()))
    result = hybrid.resume(path)
    begin = float(result["envelope/begin"])
    assert 0.0 < begin < float(result["envelope/end"]) == result.times[-1]
    (event,) = [e for e in result.events if e.kind == "envelope incomplete"]
    assert event.t == begin and result["envelope/tension_t_max"].min() > begin
    assert result["envelope/tension_max"].max() >= result.tension[result.times > begin].max() * (1 - 1e-9)
