"""Many runs of one scene with other values: computed on dask, kept batch by batch, resumed after anything.

    study.yaml -> cases (cases.py) -> batches on workers (workers.py) of a cluster
               -> what is kept -> columns -> Zarr (store/study_file.py)

A worker computes a batch of cases and returns what is kept of them; the process of the study alone writes.  Batches are
sent to workers a few ahead.  A batch counts when its status is written, after all else, so that a kill of anything
loses the batches that were under way and no more.

Batches come back in any order.  Units, places and times of what is kept are those of the first case in order that has
it, so that results do not depend on the number of workers: a batch that would be the first to have something waits
until all batches before it are written.
docs/studies.md
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from shutil import rmtree
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.accuracy.passes import run, static
from hybrid.errors import Complaint, ResultError, SceneError, optional_package
from hybrid.model.plan import plan
from hybrid.outputs.probes import PROBES
from hybrid.scene.study import LIMIT_OF, Kept, Study, read_study, study_from
from hybrid.simulation.own_parts import RunPart, checked_parts, require_parts
from hybrid.store.hdf5_file import locked
from hybrid.store.integrity import pack
from hybrid.store.records import ALIASES
from hybrid.store.study_file import FAILED, KILLED, OPEN, OWN, Column, StudyFile, counts_of, open_study
from hybrid.studies.cases import Cases, cases_of, digest_of, scene_of
from hybrid.studies.workers import (
    Job,
    Outcome,
    compute_batch,
    has_something_new,
    names_of,
    one_value_of,
    usual,
    write_outcomes,
)

if TYPE_CHECKING:
    import xarray


# --- batches -----------------------------------------------------------------------------------

# Batches that a worker has, or waits for.
AHEAD = 3


@dataclass(frozen=True)
class StudyRunning:
    """Progress of a study: cases in all, done, failed; s since it began; dask's dashboard, "" if there is none."""

    total: int
    done: int
    failed: int
    elapsed: float
    dashboard: str

    @property
    def left(self) -> int:
        return self.total - self.done - self.failed


def compute_open_batches(
    file: StudyFile,
    cases: Cases,
    wanted: Mapping[str, Kept],
    workers: int | None,
    scheduler: str | None,
    progress: Callable[[StudyRunning], None] | None,
    files: str = "",
    parts: Sequence[RunPart] = (),
) -> None:
    """Compute the batches of a study that are not done; files: folder for whole results, "": they are not kept.

    parts: of all runs, of the user's own.  ResultError when the scheduler is gone.
    """
    begin = clock.perf_counter()

    def report(dashboard: str) -> None:
        if progress is not None:
            now = counts_of(file.status)
            progress(StudyRunning(file.cases, now["done"], now["failed"], clock.perf_counter() - begin, dashboard))

    def job_of(k: int) -> Job:
        where = file.slice_of(k)
        return Job(cases.base, cases.keys, cases.rows[where], wanted, cases.static, where.start, files, parts)

    with client_of(workers, scheduler) as client:
        dashboard = str(getattr(client, "dashboard_link", "") or "")
        report(dashboard)
        batches = _Batches(client, file, job_of, lambda: report(dashboard))
        try:
            batches.compute(file.open_batches())
        except (OSError, TimeoutError, CancelledError) as error:  # distributed's errors of a lost connection are these
            raise ResultError(_gone(file, str(error) or type(error).__name__)) from None
        finally:
            with suppress(Exception):
                client.cancel(list(batches.running))


class _Batches:
    """Batches by what has become of them: running, aside because workers died of them, or computed and not written."""

    def __init__(self, client: Any, file: StudyFile, job_of: Callable[[int], Job], written: Callable[[], None]) -> None:
        self._client, self._file, self._job_of, self._written = client, file, job_of, written
        self._distributed = optional_package("distributed", "a study", "studies")
        self._waiting = self._distributed.as_completed(loop=client.loop)
        self.running: dict[Any, int] = {}
        self._aside: list[int] = []
        self._computed: dict[int, list[Outcome]] = {}

    def compute(self, batches: list[int]) -> None:
        """Compute batches, and write them."""
        left = iter(batches)
        most = AHEAD * max(sum(self._client.nthreads().values()), 1)
        while True:
            stuck = self._aside and self._computed  # what is computed waits for a batch that is aside: that one first
            while len(self.running) < most and not stuck and (k := next(left, None)) is not None:
                future = self._client.submit(compute_batch, self._job_of(k), pure=False)
                self.running[future] = k
                self._waiting.add(future)
            if self.running:
                self._receive(next(self._waiting))
            elif self._aside:
                k = self._aside.pop(0)
                self._keep(k, self._one_by_one(self._job_of(k)))
            else:
                return

    def _receive(self, future: Any) -> None:
        """Take what a batch has come to."""
        if future.status in ("lost", "pending"):  # its worker died with the result: it is computed again elsewhere
            self._waiting.add(future)
            return
        k = self.running.pop(future)
        try:
            if future.status == "cancelled":
                raise ResultError(_gone(self._file, "its tasks are cancelled"))
            self._keep(k, future.result())
        except self._distributed.KilledWorker:
            self._aside.append(k)
        future.release()

    def _one_by_one(self, job: Job) -> list[Outcome]:
        """The cases of a batch whose worker died, each alone, so that the one that kills a worker is known.

        Nothing else may run: of whatever a worker was about to compute, dask counts its death.
        """
        outcomes = []
        for k, row in enumerate(job.rows):
            future = self._client.submit(compute_batch, job._replace(rows=[row], first=job.first + k), pure=False)
            try:
                outcomes += future.result()
            except self._distributed.KilledWorker:
                outcomes.append(Outcome(FAILED, KILLED, "", np.nan, -1, {}))
            future.release()
        return outcomes

    def _keep(self, k: int, outcomes: list[Outcome]) -> None:
        """Write a batch, and those that have waited for it; or let it wait."""
        if k == 0:
            _refuse_what_is_never_kept(outcomes[0])
        self._computed[k] = outcomes
        for each in sorted(self._computed):
            first_open = np.flatnonzero(self._file.status == OPEN)[0]
            if first_open < self._file.slice_of(each).start and has_something_new(self._file, self._computed[each]):
                continue
            write_outcomes(self._file, each, self._computed.pop(each))
            self._written()


def _refuse_what_is_never_kept(first: Outcome) -> None:
    """ResultError if the first case has nothing of what is to be kept of every one, whatever the size of batches is."""
    if first.absent:
        raise ResultError(
            f"of case 0 something cannot be kept, and so of all like it: {first.absent}\n"
            "    try:      another collect; where other cases have it, one of these first"
        )


def _gone(file: StudyFile, detail: str) -> str:
    now = counts_of(file.status)
    done = now["done"] + now["failed"]
    return (
        f"the scheduler of the study is gone; {done} of {file.cases} cases are in {file.path}\n"
        f"    detail:   {detail}\n    try:      the same command goes on"
    )


# The dask cluster that a study runs on: one of this machine, or one that runs.

# So often a batch is tried whose worker died; then its cases are computed one by one.
TRIES = 3


@contextmanager
def client_of(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """A client of dask: of a cluster on this machine, or of a scheduler that runs."""
    distributed = optional_package("distributed", "a study", "studies")
    import dask

    settings = {
        "distributed.scheduler.allowed-failures": TRIES - 1,
        "distributed.comm.timeouts.connect": "20s",
        # A killed worker starts again; on a busy machine that takes longer than the 15 s after which dask gives it up,
        # and the study would wait for ever for workers that are not there.
        "distributed.deploy.lost-worker-timeout": "1h",
        "distributed.worker.profile.enabled": False,  # it stops the worker a hundred times a second to look at it
        # dask has the C library give back all memory that is freed, which a run then asks for anew: 17 % of its time.
        # These are the largest values that the library itself comes to.
        "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 64 * 1024 * 1024,
        "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 32 * 1024 * 1024,
        # While nothing happens scheduler and worker take 5 % of a core at dask's intervals, of 20 to 500 ms, here 1 %;
        # batches take seconds.
        "distributed.admin.tick.interval": "1s",
        "distributed.admin.tick.limit": "1 minute",
        "distributed.admin.system-monitor.gil.enabled": False,
        "distributed.admin.system-monitor.interval": "2s",
        "distributed.worker.memory.monitor-interval": "500ms",
    }
    with dask.config.set(settings), ExitStack() as stack:
        if scheduler is not None:
            if not re.search(r":\d+$|^inproc://", scheduler):
                raise ResultError(f"'{scheduler}' is no address of a scheduler\n    expected: such as tcp://host:8786")
            stack.enter_context(_quiet("distributed"))
            try:
                yield stack.enter_context(distributed.Client(scheduler, timeout="20s", set_as_default=False))
            except OSError as error:
                raise ResultError(f"no scheduler answers at {scheduler}\n    detail:   {error}") from None
            return
        stack.enter_context(_main_is_not_imported())
        before = os.environ.get("HYBRID_THREADS")
        os.environ["HYBRID_THREADS"] = "1"
        try:
            cluster = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=workers or os.cpu_count() or 1,
                    threads_per_worker=1,
                    dashboard_address=":0",
                    silence_logs=50,
                )
            )
            yield stack.enter_context(distributed.Client(cluster, set_as_default=False))
        finally:
            os.environ.pop("HYBRID_THREADS") if before is None else os.environ.update(HYBRID_THREADS=before)


@contextmanager
def _quiet(name: str) -> Iterator[None]:
    """Nothing is logged under a name and below it: that a scheduler is gone is said once, in our words."""
    import logging

    known = [x for x in list(logging.Logger.manager.loggerDict) if x == name or x.startswith(f"{name}.")]
    before = {x: logging.getLogger(x).level for x in known}
    for x in before:
        logging.getLogger(x).setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for x, level in before.items():
            logging.getLogger(x).setLevel(level)


@contextmanager
def _main_is_not_imported() -> Iterator[None]:
    """Workers do not import the user's script, which would run again there: they need this package alone."""
    main = sys.modules["__main__"]
    hidden = {name: vars(main)[name] for name in ("__file__", "__spec__") if vars(main).get(name) is not None}
    for name in hidden:
        setattr(main, name, None)
    try:
        yield
    finally:
        for name, value in hidden.items():
            setattr(main, name, value)


# --- a study -----------------------------------------------------------------------------------

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
    folder = target.with_name(f"{target.name.removesuffix('.zarr')}.files")
    whole = folder if asked.files else None
    with locked(target):
        if target.exists():
            there = StudyFile(target)  # nothing else is removed
            if overwrite or (there.attributes["identity"] != identity and (there.status == OPEN).all()):
                rmtree(target)
                _remove_cases(folder)
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
    named = [x if isinstance(x, list) else [x, None] for x in stored.get("parts", ())]  # in older ones names alone
    kept: dict[str, str | None] = {name: state for name, state in named}
    require_parts(parts, kept, path)
    if other := ", ".join(name for name, x in _states_of(parts) if kept[name] not in (x, None)):
        advice = "the numbers that it was given then"
        raise ResultError(f"{path} was computed with another part {other}\n    try:      {advice}")
    if not 0 <= case < len(stored["rows"]):
        raise ResultError(f"{path} has no case {case}\n    expected: 0 to {len(stored['rows']) - 1}")
    scene = scene_of(stored["base"], stored["keys"], stored["rows"][case])
    return static(scene, output) if stored["static"] else run(scene, output, parts=parts)


def _asked(
    source: Any,
    vary: Mapping[str, Any] | None,
    collect: Mapping[str, Any] | None,
    more: Mapping[str, Any],
    output: str | Path | None,
) -> tuple[Study, Path]:
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
    kept |= {"parts": _states_of(parts)} if parts else {}
    kept |= {"derive": dict(derived), "release": version("hybrid-cable")}  # results of two releases are not mixed
    return hashlib.sha256((cases.identity + json.dumps(kept, sort_keys=True)).encode()).hexdigest()[:16]


def _states_of(parts: Sequence[RunPart]) -> list[tuple[str, str]]:
    """Names of parts, and what each would keep in a checkpoint."""
    return [(x.name, pack(x.checkpoint()).hex()) for x in parts]


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
        array = values_of.astype(float) if values_of.dtype.kind == "i" else values_of
        columns[name] = Column("", asked.derive[name], (), array)
    stored = {"base": cases.base, "keys": cases.keys, "rows": rows, "static": cases.static}
    stored |= {"parts": _states_of(parts)} if parts else {}
    texts: dict[str, Any] = {"study": stored, "variables": list(columns), "files": cases.files, "bounds": cases.bounds}
    texts |= {"sample": asked.sample.model_dump() if asked.sample else None}
    texts |= {"collect": {name: each.model_dump(mode="json") for name, each in wanted.items()}}
    attributes = {name: json.dumps(x) for name, x in texts.items()}
    attributes |= {"identity": identity, "title": asked.title or Path(asked.scene).stem}
    attributes["scene_file"] = Path(asked.scene).name
    return StudyFile.create(target, columns, len(rows), batch, attributes)


def _batch_of(cases: Cases, workers: int) -> int:
    """Cases in a batch, by the predicted time of the first one."""
    seconds = 0.03 if cases.static else max(plan(cases.scene(0)).seconds, 1e-3)
    share = -(-len(cases.rows) // (AHEAD * workers))
    return int(np.clip(BATCH_TIME / seconds, 1, min(MOST_IN_BATCH, max(share, 1))))
