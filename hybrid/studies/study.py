"""Many runs of one scene with other values: computed on dask, kept batch by batch, resumed after anything.

    study.yaml -> cases (cases.py) -> batches (dispatch.py) on workers (workers.py) of a cluster (cluster.py)
               -> what is kept (collect.py) -> columns (outcomes.py) -> Zarr (store/study_file.py)

A worker computes a batch of cases and returns what is kept of them; the process of the study alone writes.  A batch
counts when its status is written, after all else, so that a kill of anything loses the batches that were under way and
no more.
docs/studies.md
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from shutil import rmtree
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.accuracy.api import run, static
from hybrid.errors import Complaint, ResultError, SceneError
from hybrid.model.plan import plan
from hybrid.outputs.probes import PROBES
from hybrid.scene.study import LIMIT_OF, Kept, Study, read_study, study_from
from hybrid.simulation.own_parts import RunPart, checked_parts, require_parts
from hybrid.store.hdf5_file import locked
from hybrid.store.integrity import pack
from hybrid.store.records import ALIASES
from hybrid.store.study_file import OPEN, OWN, Column, StudyFile, open_study
from hybrid.studies.cases import Cases, cases_of, digest_of, scene_of
from hybrid.studies.dispatch import AHEAD, StudyRunning, compute_open_batches
from hybrid.studies.workers import names_of, one_value_of, usual

if TYPE_CHECKING:
    import xarray

# s of processor time that a batch should take: long against the scheduler's milliseconds, and little is lost by a kill.
BATCH_TIME, MOST_IN_BATCH = 4.0, 200


def study(
    source: str | PathLike[str] | Study,
    output: str | Path | None = None,
    *,
    vary: Mapping[str, Any] | None = None,
    collect: Mapping[str, Any] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    batch: int | None = None,
    overwrite: bool = False,
    progress: Callable[[StudyRunning], None] | None = None,
    parts: Sequence[RunPart] = (),
    **more: Any,
) -> xarray.Dataset:
    """Compute a scene with other values of its keys, many times; returns what was kept of each run.

    source: the path of a study file, a Study, or, with `vary`, the path of a scene.  vary, collect, and more (combine,
    sample, cases, only_if, derive, static): as the keys of a study file, docs/studies.md.  output: a Zarr folder, None:
    STUDY.zarr beside the study; one that is there goes on.  workers: processes, None: one for each core; scheduler:
    address of a dask scheduler instead; batch: cases in a batch, None: by the predicted time of a run; overwrite: begin
    anew where there is a study; progress: called with a StudyRunning after every batch; parts: as of `hybrid.run`, with
    classes that workers can import or that stand in the program that is started.

    SceneError when the study or its scene is refused, ResultError when the folder holds another study or the scheduler
    is gone; what was computed until then stays, and the same call goes on.
    """
    asked, target = _asked(source, vary, collect, more, output)
    parts = checked_parts(parts)
    if asked.static and parts:
        raise ValueError("parts: expected none, because a study of equilibria has no motion")
    cases = cases_of(asked)
    wanted = asked.collect or usual(asked.static, cases.lines)
    _refuse_collisions(cases, wanted)
    _refuse_unknown_lines(cases, wanted)
    _refuse_several_values(wanted)
    _refuse_limits_not_there(cases, wanted)
    identity = _identity(cases, wanted, asked.derive, asked.files, parts)
    whole = target.with_suffix(".files") if asked.files else None
    with locked(target):
        if target.exists():
            there = StudyFile(target)  # nothing else is removed
            if overwrite or (there.attributes["identity"] != identity and (there.status == OPEN).all()):
                rmtree(target)
                _remove_cases(target.with_suffix(".files"))
        if target.exists():
            file = StudyFile(target)
            _refuse_other(file, identity)
            if around := file.failed_around:
                file.reopen(around)
        else:
            _refuse_cases(whole)
            count = workers or os.cpu_count() or 1
            file = _created(target, asked, cases, wanted, identity, batch or _batch_of(cases, count), parts)
        if file.open_batches():
            if whole is not None:
                whole.mkdir(exist_ok=True)
            compute_open_batches(file, cases, wanted, workers, scheduler, progress, str(whole or ""), parts)
    return open_study(target)


def _cases_in(folder: Path | None) -> list[Path]:
    return sorted(folder.glob("case-*.h5")) if folder is not None else []


def _remove_cases(folder: Path) -> None:
    """Remove results of cases, and snapshots of failed ones, of the study that stood in this folder.

    None of them is then read as one of the new study.
    """
    for file in (*_cases_in(folder), *folder.glob("case-*.snapshot.npz")):
        file.unlink()


def _refuse_cases(folder: Path | None) -> None:
    """ResultError where a study begins beside the whole results of another one."""
    if found := _cases_in(folder):
        raise ResultError(
            f"{folder} holds {len(found)} results of a study whose table is gone\n"
            "    expected: no case-*.h5 in it, because they would be taken for results of the study that begins\n"
            f"    try:      move or remove {folder}"
        )


def case_of(path: str | Path, case: int, output: str | Path | None = None, *, parts: Sequence[RunPart] = ()) -> Any:
    """Compute one case of a study again, with everything in its result.

    output: as of `hybrid.run`; parts: as the study was given.
    """
    if not Path(path).is_dir():
        raise ResultError(f"{path} is not the results of a study\n    expected: its folder, such as STUDY.zarr")
    attributes = StudyFile(path).attributes
    if changed := [file for file, digest in json.loads(attributes["files"]).items() if digest_of(file) != digest]:
        raise ResultError(f"{', '.join(changed)} has changed since {path} was computed: the case would be another one")
    stored, parts = json.loads(attributes["study"]), checked_parts(parts)
    require_parts(parts, stored.get("parts", ()), path)
    if not 0 <= case < len(stored["rows"]):
        raise ResultError(f"{path} has no case {case}\n    expected: 0 to {len(stored['rows']) - 1}")
    scene = scene_of(stored["base"], stored["keys"], stored["rows"][case])
    return static(scene, output) if stored["static"] else run(scene, output, parts=parts)


def _asked(
    source: Any, vary: Mapping[str, Any] | None, collect: Mapping[str, Any] | None, more: Mapping[str, Any],
    output: str | Path | None,
) -> tuple[Study, Path]:  # fmt: skip
    """The study that is meant, and where its results go."""
    given: dict[str, Any] = {"vary": vary, "collect": collect, **more}
    parts = {name: value for name, value in given.items() if value is not None}
    if isinstance(source, Study):
        found, beside = source, Path("study.zarr")
    elif parts:
        found = study_from({"scene": str(source)} | parts)
        beside = Path(f"{Path(str(source)).stem}.zarr")
    else:
        found, beside = read_study(str(source)), Path(str(source)).with_suffix(".zarr")
    return found, Path(output if output is not None else beside).expanduser().resolve()


def _refuse_collisions(cases: Cases, wanted: Mapping[str, Kept]) -> None:
    """SceneError where something that is kept has the name of a variable, of a derived column or of another thing."""
    names = names_of(wanted)
    both = set(names) & {*cases.keys, *cases.derived, *OWN, "case", "s"}
    if both or len(names) < sum(len(kept.take) for kept in wanted.values()):
        given = ", ".join(sorted(both)) or "the same name twice"
        expected = "names of their own, also with _max and the like behind them, for what is kept"
        raise SceneError([Complaint("collect", given, expected, "another name")])


def _refuse_unknown_lines(cases: Cases, wanted: Mapping[str, Kept]) -> None:
    """SceneError where something is to be kept of a line that is not there, or of none where there are several."""
    for name, kept in wanted.items():
        if kept.line is not None and kept.line not in cases.lines:
            expected = f"one of {', '.join(cases.lines)}" if cases.lines else "nothing, because the scene has one line"
            raise SceneError([Complaint(f"collect.{name}.line", kept.line, expected, "see `lines` of the scene")])
        if kept.line is None and cases.lines and (kept.curve or {"profile"} & set(kept.take)):
            expected = f"one of {', '.join(cases.lines)}: what lies along a line is of one of them"
            raise SceneError([Complaint(f"collect.{name}.line", "nothing", expected, f"line: {cases.lines[0]}")])


def _refuse_several_values(wanted: Mapping[str, Kept]) -> None:
    """SceneError where a quantity is to be kept that has several values at a time, such as a force."""
    for name, kept in wanted.items():
        probe = PROBES.get(ALIASES.get(kept.quantity, kept.quantity))
        if probe is None or not probe.dims or "s" in probe.dims:
            continue
        fix = one_value_of(kept.quantity)
        expected = f"a quantity with one value at a time, or along the line: it has {', '.join(probe.dims)}"
        raise SceneError([Complaint(f"collect.{name}.quantity", kept.quantity, expected, fix)])


def _refuse_limits_not_there(cases: Cases, wanted: Mapping[str, Kept]) -> None:
    """SceneError where the part of a limit is to be kept that no section of any case has."""
    for name, kept in wanted.items():
        limit = LIMIT_OF.get(kept.quantity, "")
        varied = any(limit in path for paths in cases.keys.values() for path in paths) or _has(cases.rows, limit)
        if "utilisation" not in kept.take or varied:
            continue
        line = cases.lines and kept.line
        if not _has(cases.base["lines"][line] if line else cases.base, limit):
            expected = f"a quantity with a limit: no section{f' of line {line}' if line else ''} has a {limit}"
            fix = f"{limit} in the sections of the scene, or leave utilisation of {kept.quantity} out"
            raise SceneError([Complaint(f"collect.{name}.take", "utilisation", expected, fix)])


def _has(data: Any, key: str) -> bool:
    """Whether a scene as data has a key in any of its tables."""
    if isinstance(data, Mapping):
        return data.get(key) is not None or any(_has(x, key) for x in data.values())
    return isinstance(data, list | tuple) and any(_has(x, key) for x in data)


def _identity(
    cases: Cases, wanted: Mapping[str, Kept], derived: Mapping[str, str], files: bool, parts: Sequence[RunPart]
) -> str:
    kept: dict[str, Any] = {name: each.model_dump(mode="json") for name, each in wanted.items()}
    kept |= {"whole files": True} if files else {}
    kept |= {"parts": [[x.name, pack(x.checkpoint()).hex()] for x in parts]} if parts else {}
    kept |= {"derive": dict(derived), "release": version("hybrid-cable")}  # results of two releases are not mixed
    return hashlib.sha256((cases.identity + json.dumps(kept, sort_keys=True)).encode()).hexdigest()[:16]


def _refuse_other(file: StudyFile, identity: str) -> None:
    if file.attributes["identity"] != identity:
        raise ResultError(
            f"{file.path} holds another study: its scene, values, files, what is kept or the release have changed\n"
            "    try:      -o with another name, or --overwrite to begin anew"
        )


def _created(
    target: Path,
    asked: Study,
    cases: Cases,
    wanted: Mapping[str, Kept],
    identity: str,
    batch: int,
    parts: Sequence[RunPart],
) -> StudyFile:
    rows = cases.rows
    columns = {}
    for name in rows[0]:
        values = [row[name] for row in rows]
        plain = all(isinstance(x, int | float) for x in values)
        array = (
            np.array(values, float) if plain else np.array([x if isinstance(x, str) else json.dumps(x) for x in values])
        )
        columns[name] = Column(cases.units.get(name, ""), ", ".join(cases.keys[name]), (), array)
    for name, values_of in cases.derived.items():
        columns[name] = Column("", asked.derive[name], (), np.asarray(values_of))
    stored = {"base": cases.base, "keys": cases.keys, "rows": rows, "static": cases.static}
    stored |= {"parts": [x.name for x in parts]} if parts else {}
    attributes = {
        "identity": identity, "title": asked.title or Path(asked.scene).stem, "study": json.dumps(stored),
        "variables": json.dumps(list(columns)), "scene_file": Path(asked.scene).name,
        "files": json.dumps(cases.files), "sample": json.dumps(asked.sample.model_dump() if asked.sample else None),
        "bounds": json.dumps(cases.bounds),
        "collect": json.dumps({name: each.model_dump(mode="json") for name, each in wanted.items()}),
    }  # fmt: skip
    return StudyFile.create(target, columns, len(rows), batch, attributes)


def _batch_of(cases: Cases, workers: int) -> int:
    """Cases in a batch, by the predicted time of the first one."""
    seconds = 0.03 if cases.static else max(plan(cases.scene(0)).seconds, 1e-3)
    share = -(-len(cases.rows) // (AHEAD * workers))
    return int(np.clip(BATCH_TIME / seconds, 1, min(MOST_IN_BATCH, max(share, 1))))
