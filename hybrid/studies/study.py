"""Many runs of one scene with other values: computed on dask, kept batch by batch, resumed after anything.

    study.yaml -> cases (cases.py) -> batches on workers -> what is kept (collect.py) -> Zarr (store/study_file.py)

A worker computes a batch of cases and returns what is kept of them; this process alone writes.  A batch counts when its
status is written, after all else, so that a kill of anything loses the batches that were under way and no more.
docs/studies.md
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import time as clock
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from shutil import rmtree
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.errors import EVENTS_BY_WEIGHT, Complaint, HybridError, ResultError, SceneError
from hybrid.model.plan import plan
from hybrid.scene.study import Kept, Study, read_study, study_from
from hybrid.simulation.api import run, static
from hybrid.store.lock import locked
from hybrid.store.selection import optional_package
from hybrid.store.study_file import DONE, FAILED, OPEN, OWN, Column, StudyFile, counts_of, open_study
from hybrid.studies.cases import Cases, cases_of, digest_of, scene_of
from hybrid.studies.collect import Variable, collected, names_of, usual

if TYPE_CHECKING:
    import xarray

# s of processor time that a batch should take: long against the scheduler's milliseconds, and little is lost by a kill.
BATCH_TIME, MOST_IN_BATCH = 4.0, 200
# Batches that a worker has, or waits for.
AHEAD = 3
# So often a batch is tried whose worker died; then its cases are computed one by one.
TRIES = 3
# How the reason of a case begins that was computed, and of which something could not be kept.
NOT_KEPT = "not kept: "


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


class Job(NamedTuple):
    """What a worker needs to know of a batch: the scene, the keys, and the rows of its cases."""

    base: Mapping[str, Any]
    keys: Mapping[str, tuple[str, ...]]
    rows: list[dict[str, Any]]
    wanted: Mapping[str, Kept]
    static: bool


class Outcome(NamedTuple):
    """Of one case: status, reason, events, s of processor time, steps, and what was kept."""

    status: int
    reason: str
    events: str
    cpu: float
    steps: int
    kept: dict[str, tuple[Variable, np.ndarray]]


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
    **more: Any,
) -> xarray.Dataset:
    """Compute a scene with other values of its keys, many times; returns what was kept of each run.

    source: the path of a study file, a Study, or, with `vary`, the path of a scene.  vary, collect, and more (combine,
    sample, cases, only_if, derive, static): as the keys of a study file, docs/studies.md.  output: a Zarr folder, None:
    STUDY.zarr beside the study; one that is there goes on.  workers: processes, None: one for each core; scheduler:
    address of a dask scheduler instead; batch: cases in a batch, None: by the predicted time of a run; overwrite: begin
    anew where there is a study; progress: called with a StudyRunning after every batch.

    SceneError when the study or its scene is refused, ResultError when the folder holds another study or the scheduler
    is gone; what was computed until then stays, and the same call goes on.
    """
    asked, target = _asked(source, vary, collect, more, output)
    cases = cases_of(asked)
    wanted = asked.collect or usual(asked.static, cases.lines)
    _refuse_collisions(cases, wanted)
    _refuse_unknown_lines(cases, wanted)
    identity = _identity(cases, wanted, asked.derive)
    with locked(target):
        if target.exists() and overwrite:
            StudyFile(target)  # nothing else is removed
            rmtree(target)
        if target.exists():
            file = StudyFile(target)
            _refuse_other(file, identity)
        else:
            count = workers or os.cpu_count() or 1
            file = _created(target, asked, cases, wanted, identity, batch or _batch_of(cases, count))
        if file.open_batches():
            _compute(file, cases, wanted, workers, scheduler, progress)
    return open_study(target)


def case_of(path: str | Path, case: int, output: str | Path | None = None) -> Any:
    """Compute one case of a study again, with everything in its result; output: as of `hybrid.run`."""
    if not Path(path).is_dir():
        raise ResultError(f"{path} is not the results of a study\n    expected: its folder, such as STUDY.zarr")
    attributes = StudyFile(path).attributes
    if changed := [file for file, digest in json.loads(attributes["files"]).items() if digest_of(file) != digest]:
        raise ResultError(f"{', '.join(changed)} has changed since {path} was computed: the case would be another one")
    stored = json.loads(attributes["study"])
    if not 0 <= case < len(stored["rows"]):
        raise ResultError(f"{path} has no case {case}\n    expected: 0 to {len(stored['rows']) - 1}")
    scene = scene_of(stored["base"], stored["keys"], stored["rows"][case])
    return static(scene, output) if stored["static"] else run(scene, output)


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


def _identity(cases: Cases, wanted: Mapping[str, Kept], derived: Mapping[str, str]) -> str:
    kept: dict[str, Any] = {name: each.model_dump(mode="json") for name, each in wanted.items()}
    kept |= {"derive": dict(derived), "release": version("hybrid-cable")}  # results of two releases are not mixed
    return hashlib.sha256((cases.identity + json.dumps(kept, sort_keys=True)).encode()).hexdigest()[:16]


def _refuse_other(file: StudyFile, identity: str) -> None:
    if file.attributes["identity"] != identity:
        raise ResultError(
            f"{file.path} holds another study: its scene, values, files, what is kept or the release have changed\n"
            "    try:      -o with another name, or --overwrite to begin anew"
        )


def _created(
    target: Path, asked: Study, cases: Cases, wanted: Mapping[str, Kept], identity: str, batch: int
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
    attributes = {
        "identity": identity, "title": asked.title or Path(asked.scene).stem, "study": json.dumps(stored),
        "variables": json.dumps(list(columns)), "scene_file": Path(asked.scene).name,
        "files": json.dumps(cases.files), "sample": json.dumps(asked.sample.model_dump() if asked.sample else None),
        "bounds": json.dumps(cases.bounds),
    }  # fmt: skip
    return StudyFile.create(target, columns, len(rows), batch, attributes)


def _batch_of(cases: Cases, workers: int) -> int:
    """Cases in a batch, by the predicted time of the first one."""
    seconds = 0.03 if cases.static else max(plan(cases.scene(0)).seconds, 1e-3)
    share = -(-len(cases.rows) // (AHEAD * workers))
    return int(np.clip(BATCH_TIME / seconds, 1, min(MOST_IN_BATCH, max(share, 1))))


# ---- on the workers -------------------------------------------------------------------------------


def compute_batch(job: Job) -> list[Outcome]:
    """Compute the cases of a batch, one after the other, in one thread."""
    os.environ["HYBRID_THREADS"] = "1"
    return [_computed(job, row) for row in job.rows]


def _computed(job: Job, row: dict[str, Any]) -> Outcome:
    begin = clock.process_time()
    try:
        scene = scene_of(job.base, job.keys, row)
        result = static(scene) if job.static else run(scene)
    except SceneError as error:
        first = error.complaints[0]
        reason = f"refused: {first.where}: given {first.value}, expected {first.expected}"
        return Outcome(FAILED, reason, "", clock.process_time() - begin, -1, {})
    except HybridError as error:
        return Outcome(FAILED, str(error).splitlines()[0], "", clock.process_time() - begin, -1, {})
    except (ArithmeticError, ValueError, LookupError, TypeError, AssertionError) as error:
        return Outcome(FAILED, f"a bug: {type(error).__name__}: {error}", "", clock.process_time() - begin, -1, {})
    spent = clock.process_time() - begin
    with result:
        kinds = {event.kind for event in result.events}
        events = ", ".join([*(k for k in EVENTS_BY_WEIGHT if k in kinds), *sorted(kinds - set(EVENTS_BY_WEIGHT))])
        logged = next(iter(result.lines.values()), result)
        steps = len(logged["steps/t"]) if "steps/t" in logged else 0
        try:
            return Outcome(DONE, "", events, spent, steps, collected(result, job.wanted))
        except (HybridError, KeyError, AttributeError) as error:
            return Outcome(FAILED, NOT_KEPT + str(error).splitlines()[0], events, spent, steps, {})


# ---- here -----------------------------------------------------------------------------------------


def _compute(
    file: StudyFile, cases: Cases, wanted: Mapping[str, Kept], workers: int | None, scheduler: str | None,
    progress: Callable[[StudyRunning], None] | None,
) -> None:  # fmt: skip
    """Send the open batches to workers, a few ahead of each, and write what comes back."""
    begin, total = clock.perf_counter(), file.cases

    def tell(dashboard: str) -> None:
        if progress is not None:
            now = counts_of(file.status)
            progress(StudyRunning(total, now["done"], now["failed"], clock.perf_counter() - begin, dashboard))

    def job_of(k: int) -> Job:
        return Job(cases.base, cases.keys, cases.rows[file.slice_of(k)], wanted, cases.static)

    left = iter(file.open_batches())
    with _client(workers, scheduler) as client:
        distributed = optional_package("distributed", "a study", "studies")
        dashboard = str(getattr(client, "dashboard_link", "") or "")
        tell(dashboard)
        running: dict[Any, int] = {}
        threads = max(sum(client.nthreads().values()), 1)

        def send(k: int) -> Any:
            future = client.submit(compute_batch, job_of(k), pure=False)
            running[future] = k
            return future

        first = [send(k) for _, k in zip(range(AHEAD * threads), left, strict=False)]
        waiting = distributed.as_completed(first, loop=client.loop)
        try:
            for future in waiting:
                k = running.pop(future)
                if future.status == "error":
                    outcomes = _one_by_one(client, job_of(k), future.exception(), distributed)
                elif future.status == "finished":
                    outcomes = future.result()
                else:
                    raise ResultError(_gone(file, future.status))
                _refuse_what_is_never_kept(file, outcomes)
                _write(file, k, outcomes)
                future.release()
                tell(dashboard)
                following = next(left, None)
                if following is not None:
                    waiting.add(send(following))
        except (OSError, TimeoutError) as error:  # distributed's errors of a lost connection are these
            raise ResultError(_gone(file, str(error) or type(error).__name__)) from None
        finally:
            with suppress(Exception):
                client.cancel(list(running))


def _refuse_what_is_never_kept(file: StudyFile, outcomes: list[Outcome]) -> None:
    """ResultError if of the first batch nothing could be kept, for the reason of `collect`: so it would be of all."""
    reasons = {one.reason for one in outcomes if one.reason.startswith(NOT_KEPT)}
    if len(reasons) == 1 and all(one.reason in reasons for one in outcomes) and not (file.status != OPEN).any():
        detail = reasons.pop().removeprefix(NOT_KEPT)
        raise ResultError(
            f"of the first {len(outcomes)} cases nothing could be kept: {detail}\n    try:      another collect"
        )


def _gone(file: StudyFile, detail: str) -> str:
    now = counts_of(file.status)
    done = now["done"] + now["failed"]
    return (
        f"the scheduler of the study is gone; {done} of {file.cases} cases are in {file.path}\n"
        f"    detail:   {detail}\n    try:      the same command goes on"
    )


def _one_by_one(client: Any, job: Job, error: BaseException, distributed: Any) -> list[Outcome]:
    """The cases of a batch whose worker died, each alone, so that the one that kills a worker is known."""
    if not isinstance(error, distributed.KilledWorker):
        raise error
    outcomes = []
    for row in job.rows:
        future = client.submit(compute_batch, job._replace(rows=[row]), pure=False)
        try:
            outcomes += future.result()
        except distributed.KilledWorker:
            outcomes.append(Outcome(FAILED, "its worker died at every try (out of memory?)", "", np.nan, -1, {}))
    return outcomes


@contextmanager
def _client(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """A client of dask: of a cluster on this machine, or of a scheduler that runs."""
    distributed = optional_package("distributed", "a study", "studies")
    import dask

    settings = {
        "distributed.scheduler.allowed-failures": TRIES - 1, "distributed.comm.timeouts.connect": "20s",
        "distributed.worker.profile.enabled": False,  # it stops the worker a hundred times a second to look at it
    }  # fmt: skip
    with dask.config.set(settings), ExitStack() as stack:
        if scheduler is not None:
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


def _write(file: StudyFile, batch: int, outcomes: list[Outcome]) -> None:
    """Outcomes of a batch as columns; arrays that do not fit those of the study are left out, with the reason."""
    shapes: dict[str, tuple[int, ...]] = {}
    variables: dict[str, Variable] = {}
    coordinates: dict[str, Column] = {}
    fitting = []
    for one in outcomes:
        kept, why = dict(one.kept), []
        for name, (variable, values) in one.kept.items():
            if not _fits(file, shapes, coordinates, name, variable, values):
                why.append(f"{name}, whose times or places are not those of the cases before")
                del kept[name]
        if why:
            one = one._replace(reason=NOT_KEPT + "; ".join(why), kept=kept)
        for name, (variable, _) in one.kept.items():
            variables.setdefault(name, variable)
        fitting.append(one)
    columns: dict[str, Column] = {}
    for name, variable in variables.items():
        values = np.full((len(fitting), *shapes[name]), np.nan)
        for k, one in enumerate(fitting):
            if name in one.kept:
                values[k] = one.kept[name][1]
        columns[name] = Column(variable.unit, variable.description, variable.dims, values)
    for name, (unit, text, kind, _) in OWN.items():
        array = np.array([getattr(one, name) for one in fitting], dtype=object if kind is str else kind)
        columns[name] = Column(unit, text, (), array)
    file.add(batch, columns, coordinates)


def _fits(
    file: StudyFile, shapes: dict[str, tuple[int, ...]], coordinates: dict[str, Column], name: str, variable: Variable,
    values: np.ndarray,
) -> bool:  # fmt: skip
    """Whether an array has the shape, times and places of the study; those of the first one become the study's."""
    new = {}
    for dim, (unit, along) in variable.coordinates.items():
        known = coordinates[dim].values if dim in coordinates else file.coordinate(dim)
        if known is None:
            new[dim] = Column(unit, "arc length" if unit == "m" else "time", (), np.asarray(along, float))
        elif known.shape != np.shape(along) or not np.allclose(known, along, rtol=1e-9, atol=1e-12):
            return False
    if shapes.get(name, values.shape) != values.shape:
        return False
    shapes[name] = values.shape
    coordinates.update(new)
    return True
