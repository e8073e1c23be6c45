"""What else can be done with the file of a cable works with that of its network: to resume it, to let it wait."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from hybrid.errors import ComputationError
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import first_resolution
from hybrid.scene.read import as_scene, scene_text
from hybrid.scene.short_form import LINE, network_of
from hybrid.simulation.case import Case
from hybrid.simulation.case_at_rest import CaseAtRest
from hybrid.simulation.network_run import NetworkRun, Recording
from hybrid.simulation.restart import LoadChange
from hybrid.simulation.run_file import Cable
from hybrid.store.array_contents import MemoryTarget
from hybrid.store.reader import open_result, written_result
from hybrid.store.records import ERROR_ESTIMATE
from hybrid.store.writer import WriteMode
from tests.combinations.networks import both_files, exact_scene, files_differ, network_run, recorded
from tests.combinations.pairs import END, FEATURES, scene_of
from tests.problems import tables_with

FREE = {END: {"kind": "free", "force": [40, 3, 30]}}
QUANTITIES = {"output.quantities": {"angle": {"kind": "azimuth", "end": "start"}}}


def test_an_interrupted_run_goes_on_with_its_file(tmp_path: Path) -> None:
    scene = exact_scene(tables_with(scene_of(), FEATURES["seabed"][0] | QUANTITIES))
    whole, cut = tmp_path / "whole.h5", tmp_path / "cut.h5"
    recorded(network_run(scene, whole))
    recorded(network_run(scene, cut), looks=2)
    with open_result(cut) as result:
        assert result.status == "interrupted"
        assert 0.0 < result.t[-1] < scene.require_time().duration
    recorded(network_run(scene, cut, source=cut))
    assert files_differ(whole, cut) == []


def test_other_loads_are_told_as_those_of_a_cable(tmp_path: Path) -> None:
    tables = tables_with(scene_of(), FREE)
    change = LoadChange(0.2, exact_scene(tables_with(tables, {END + ".force": [10, 3, 30]})))
    assert files_differ(*both_files(exact_scene(tables), tmp_path, [change])) == []


def test_a_file_that_is_late_waits_until_it_is_amended(tmp_path: Path) -> None:
    scene, late = exact_scene(scene_of()), tmp_path / "late.h5"
    notes = [("model chosen", "a rod")]
    run = network_run(scene, late, mode=WriteMode({}, late=True, unseen=True), pending=ERROR_ESTIMATE, notes=notes)
    run.recorder.amended = True
    assert not late.exists()
    recorded(run)
    assert not late.exists()
    run.recorder.late_file.place()
    with open_result(late) as result:
        assert result.pending
        assert [(x.kind, x.text, x.s_b) for x in result.events if x.kind == "model chosen"] == [
            (*notes[0], scene.length)
        ]


def test_a_result_in_memory(tmp_path: Path) -> None:
    scene, arrays, image = exact_scene(scene_of()), MemoryTarget(), io.BytesIO()
    (tmp_path / "file.h5").unlink(missing_ok=True)
    for target in (arrays, image, tmp_path / "file.h5"):
        recorded(network_run(scene, target))
    file, *others = (written_result(x) for x in (tmp_path / "file.h5", arrays, image))
    for each in others:
        assert each.names == file.names
        np.testing.assert_array_equal(each["tension"], file["tension"])


def test_what_fails_is_said_of_the_cable(tmp_path: Path) -> None:
    scene = exact_scene(tables_with(scene_of(), {END: {"kind": "free", "force": {"value": [1e7, 0, 0], "ramp": 0.4}}}))
    said, case = [], Case(scene, None)
    for k, compute in enumerate(
        (lambda x: case.record(NetworkResolution.of(case.lines), x), lambda x: recorded(network_run(scene, x)))
    ):
        target = tmp_path / f"{k}.h5"
        with pytest.raises(ComputationError) as failed:
            compute(target)
        with open_result(target) as result:
            assert result.message == str(failed.value)
            events = [x.text.replace(str(failed.value.snapshot), "") for x in result.events]
        with np.load(failed.value.snapshot) as snapshot:
            left = sorted(snapshot.files), str(snapshot["scene"])
        said.append(
            (
                failed.value.detail,
                failed.value.s,
                failed.value.line_name,
                events,
                left,
            )
        )
    assert said[0] == said[1]


def test_a_file_at_rest_is_that_of_a_cable(tmp_path: Path) -> None:
    scene = exact_scene(tables_with(scene_of("seabed"), {"time": None, "output.every": None} | QUANTITIES))
    cable, network = tmp_path / "cable.h5", tmp_path / "network.h5"
    resolution = NetworkResolution({LINE: first_resolution(scene)})
    CaseAtRest(scene).record(resolution, cable)
    run = NetworkRun(network_of(scene), network, scene_text(scene), False, resolution, Recording(cable=Cable(scene)))
    run.record_equilibrium()
    assert files_differ(cable, network) == []


@pytest.mark.parametrize("flat", [True, False])
def test_a_start_from_which_no_step_leads_on_is_in_the_file(flat: bool, tmp_path: Path) -> None:
    scene = as_scene(scene_of("obstacle") | {"dimension": 2})
    recording = {} if flat else {"cable": None}
    with pytest.raises(ComputationError, match="leaves the plane"):
        recorded(network_run(scene, tmp_path / "run.h5", **recording))
    with open_result(tmp_path / "run.h5") as result:
        assert result.status == "failed"
        assert result.times.tolist() == [0.0]
        (name,) = result.lines or ("",)
        assert np.isfinite((result.lines[name] if name else result)["tension"]).all()
