"""Cases of a study are what a user wrote: whatever kind, file, name or order of cases it has, and whatever is kept of them."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import hybrid
from tests.scenes import pinned_at, span

pytestmark = pytest.mark.needs("dask", "zarr", "xarray", "simpleeval", "SALib")


def study(folder, scene, output="a.zarr", **more):
    (folder / "p.yaml").write_text(json.dumps(scene))
    return hybrid.study(folder / "p.yaml", folder / output, workers=1, **{"static": True} | more)


T0 = {"T": {"quantity": "tension"}}


def test_shares_are_those_where_the_cases_are_that_were_computed(tmp_path):
    scene = span(time=(8.0, 0.1), output={"every": 0.5, "points": 5}, model={"kind": "catenary", "slack": "stop"})
    scene["ends"]["end"] = pinned_at(80, 0, 0, motion={"heave": {"amplitude": 1.0, "period": 4}, "ramp": 4})
    rows, found = [f"2,{a}\n" for a in (0.1, 0.2, 0.3, 0.4)], []
    for k, table in enumerate((["6,8\n", *rows], [*rows, "6,8\n"])):
        (tmp_path / "c.csv").write_text("cable.sections[0].mass,ends.end.motion.heave.amplitude\n" + "".join(table))
        what = {"T": {"quantity": "end_force_end"}}
        study(tmp_path, scene, f"{k}.zarr", cases=str(tmp_path / "c.csv"), collect=what, static=False)
        found.append(hybrid.shares(tmp_path / f"{k}.zarr", "T").rows[0].derivative)
    assert found[0] == found[1]


@pytest.mark.parametrize("at", [[40, 50, 45], [50, 40, 45]])
def test_a_place_that_jumps_in_some_cases_alone(tmp_path, at):
    scene = span()
    scene["cable"]["attachments"] = [{"kind": "clump", "at": 40, "mass": 20}]
    found = [
        study(
            tmp_path,
            scene,
            f"{n}.zarr",
            vary={"cable.attachments[0].at": at},
            batch=n,
            collect={"T": {"quantity": "tension", "at": 50}},
        )["T"].values
        for n in (1, 2, 3)
    ]
    assert np.array_equal(found[0], found[1], equal_nan=True) and np.array_equal(found[0], found[2], equal_nan=True)


def test_a_kind_may_vary(tmp_path):
    scene = span(model={"kind": "catenary"})
    scene["cable"]["sections"][0]["bending_stiffness"] = 100.0
    assert study(tmp_path, scene, vary={"model.kind": ["rod", "catenary"]}, collect=T0).status.values.tolist() == [1, 1]


def test_profiles_of_what_jumps_and_what_does_not_stand_side_by_side(tmp_path):
    scene = span()
    scene["cable"]["attachments"] = [{"kind": "clump", "at": 40, "mass": 20}]
    what = {x: {"quantity": x, "take": ["profile"]} for x in ("tension", "z")}
    found = study(tmp_path, scene, vary={"cable.attachments[0].mass": [20, 30]}, collect=what)
    assert found.tension_profile.shape == found.z_profile.shape == (2, 101) and not any(found.reason.values)


def test_whole_results_belong_to_the_study_of_their_name(tmp_path):
    more = {"vary": {"cable.sections[0].mass": [2, 3]}, "collect": T0}
    study(tmp_path, span(), "depth_0.5", files=True, **more)
    study(tmp_path, span(), "depth_0.7", **more)
    study(tmp_path, span(), "depth_0.7", overwrite=True, **more)
    assert len(list(tmp_path.rglob("case-*.h5"))) == 2


def test_files_in_tables_of_values_are_beside_the_scene(tmp_path, monkeypatch):
    def write(size):
        rows = (f"{t:g},80,0,{size * (1 - math.cos(0.6 * t))}\n" for t in np.arange(0, 10, 0.1))
        (tmp_path / "m.csv").write_text("t,x,y,z\n" + "".join(rows))

    scene, away = span(time=(5.0, 0.1), output={"every": 0.5}), tmp_path / "away"
    more = {"vary": {"ends.end.motion": [{"file": "m.csv", "ramp": 4}]}, "collect": T0, "static": False}
    away.mkdir()
    monkeypatch.chdir(away)
    write(1.0)
    assert study(tmp_path, scene, **more).status.values.tolist() == [1]
    write(2.0)
    with pytest.raises(hybrid.ResultError, match="another study"):
        study(tmp_path, scene, **more)


def test_a_key_may_vary_under_its_former_name(tmp_path):
    waves = {"kind": "jonswap", "significant_height": 1.0, "peak_period": 8.0, "direction": 0, "seed": 1, "ramp": 2}
    scene = span(
        time=(2.0, 0.1), output={"every": 0.5}, fluid={"density": 1025, "surface": 0, "waves": waves | {"depth": 50}}
    )
    scene["cable"]["sections"][0]["drag"] = {"normal": 1.2}
    found = study(tmp_path, scene, vary={"environment.fluid.waves.height": [1.0, 2.0]}, collect=T0, static=False)
    assert found.status.values.tolist() == [1, 1]


def test_displacement_is_kept_of_every_step(tmp_path):
    scene = span(time=(4.0, 0.1), output={"every": 0.5})
    scene["ends"]["end"] = pinned_at(80, 0, 0, motion={"heave": {"amplitude": 1.0, "period": 4}, "ramp": 4})
    found = study(
        tmp_path,
        scene,
        vary={"cable.sections[0].mass": [2.0]},
        collect={"d": {"quantity": "displacement"}},
        static=False,
    )
    assert found.d.values[0] == hybrid.run(scene)["envelope/displacement_max"].max() and found.d.units == "m"


def test_derived_columns_are_ranked_however_numbers_are_written(tmp_path):
    for k, values in enumerate(([2, 3, 4, 5], [2.0, 3.0, 4.0, 5.0])):
        vary = {"m": {"key": "cable.sections[0].mass", "values": values}}
        study(tmp_path, span(), f"{k}.zarr", vary=vary, derive={"d": "(m-3)*(m-3)"}, collect=T0)
        assert {x.variable for x in hybrid.sensitivity(tmp_path / f"{k}.zarr", "T")} == {"m", "d"}


def test_shares_of_a_design_that_a_condition_has_cut(tmp_path):
    vary = {"m": {"key": "cable.sections[0].mass", "low": 2, "high": 2.4}}
    vary |= {"EA": {"key": "cable.sections[0].axial_stiffness", "low": 1e6, "high": 2e6}}
    sample = {"method": "saltelli", "count": 8}
    study(
        tmp_path, span(), vary=vary, sample=sample, only_if="m < 2.3", collect={"T": {"quantity": "tension", "at": 0}}
    )
    assert hybrid.shares(tmp_path / "a.zarr", "T").rows[0].variable == "m"
    with pytest.raises(hybrid.ResultError, match="only_if"):
        hybrid.sensitivity(tmp_path / "a.zarr", "T")


@pytest.mark.parametrize("key", ["near", "initial_guess"])
def test_a_coordinate_may_vary_under_the_former_name_of_its_place(tmp_path, key):
    scene = span()
    scene["ends"]["end"] = {"kind": "body", "mass": 50.0, "volume": 0.0, "initial_guess": [10, 0, -90]}
    (tmp_path / "p.yaml").write_text(json.dumps(scene))
    more = {"vary": {f"ends.end.{key}[0]": [10, 12]}, "collect": {"T": {"quantity": "tension"}}, "static": True}
    found = hybrid.study(tmp_path / "p.yaml", tmp_path / "a.zarr", workers=1, **more)
    assert found.status.values.tolist() == [1, 1]
