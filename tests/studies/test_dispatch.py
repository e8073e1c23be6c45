"""Batches of a study that come back in any order, whose workers die, or whose results are lost on the way."""

from __future__ import annotations

import errno
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import extras
import numpy as np
import pytest

pytestmark = extras.of_file("dask")

import distributed

from hybrid.errors import ResultError
from hybrid.store.study_file import DONE, FAILED, Column, StudyFile, open_study
from hybrid.studies import study as study_module
from hybrid.studies.workers import Job, Outcome, Variable

CASES, BATCH = 8, 2


class Future:
    """A task of the Pool: a worker that dies of a case raises what dask raises."""

    def __init__(self, compute: Callable[[Job], list[Outcome]], job: Job, pool: Pool) -> None:
        self.compute, self.job, self.pool, self.status = compute, job, pool, "finished"

    def result(self) -> list[Outcome]:
        self.pool.running -= 1
        return self.compute(self.job)

    def release(self) -> None:
        pass


class Pool:
    """In place of a client and of what waits for its tasks: they end in the order of `order`, one may be lost first."""

    loop = None

    def __init__(self, compute: Callable[[Job], list[Outcome]], order: list[int], lost: str = "") -> None:
        self.compute, self.order, self.lost = compute, order, lost
        self.ready: list[Future] = []
        self.running, self.alone = 0, []

    def nthreads(self) -> dict[str, int]:
        return {"a": 1, "b": 1}

    def submit(self, _: object, job: Job, pure: bool) -> Future:
        self.running += 1
        if len(job.rows) == 1:
            self.alone.append(self.running)
        return Future(self.compute, job, self)

    def add(self, future: Future) -> None:
        self.ready.append(future)

    def __next__(self) -> Future:
        now = min(self.ready, key=lambda each: self.order.index(each.job.rows[0]["x"] // BATCH))
        self.ready.remove(now)
        if self.lost:
            now.status, self.lost = self.lost, ""
        else:
            now.status = "finished"
        return now


def outcome(x: int) -> Outcome:
    """What is kept of a case: a number, and a profile, of fewer places where x is 0 or 1."""
    places = np.arange(3.0 if x < 2 else 4.0)
    profile = Variable("N", f"as of case {x}", ("s",), {"s": ("m", places)})
    number = Variable("N", f"as of case {x}", (), {})
    return Outcome(DONE, "", "", 0.1, 5, {"most": (number, np.asarray(1.0 * x)), "along": (profile, x + places)})


def computed(path: Path, pool: Pool, monkeypatch: pytest.MonkeyPatch) -> StudyFile:
    rows = [{"x": x} for x in range(CASES)]
    column = Column("", "x", (), np.arange(CASES))
    file = StudyFile.create(path, {"x": column}, CASES, BATCH, {})
    monkeypatch.setattr(distributed, "as_completed", lambda loop: pool)

    def job_of(k: int) -> Job:
        return Job({}, {}, rows[file.slice_of(k)], {}, False)

    study_module._Batches(pool, file, job_of, lambda: None).compute(file.open_batches())
    return file


def values(file: StudyFile, name: str) -> np.ndarray:
    return np.asarray(file._group[name][:])


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1]])
def test_places_are_those_of_the_first_case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, order: list[int]) -> None:
    """Whatever batch comes back first, the places of a profile and descriptions are those of case 0."""
    pool = Pool(lambda job: [outcome(row["x"]) for row in job.rows], order)
    file = computed(tmp_path / "x.zarr", pool, monkeypatch)
    assert (file.status == DONE).all()
    assert values(file, "s").tolist() == [0.0, 1.0, 2.0] and values(file, "most").tolist() == list(range(CASES))
    assert np.isfinite(values(file, "along")).all(axis=1).tolist() == [True] * 2 + [False] * 6
    assert file._group["along"].attrs["long_name"] == "as of case 0"


@pytest.mark.parametrize("status", ["lost", "pending"])
def test_a_result_that_is_lost_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: str) -> None:
    """Its worker died after it had computed the batch: another one computes it again."""
    pool = Pool(lambda job: [outcome(row["x"]) for row in job.rows], [0, 1, 2, 3], lost=status)
    assert (computed(tmp_path / "x.zarr", pool, monkeypatch).status == DONE).all()


def test_a_scheduler_that_is_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pool = Pool(lambda job: [outcome(row["x"]) for row in job.rows], [0, 1, 2, 3], lost="cancelled")
    with pytest.raises(ResultError, match="the same command goes on"):
        computed(tmp_path / "x.zarr", pool, monkeypatch)


def test_a_disk_that_is_full_is_no_scheduler_that_is_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The study says so, in place of "the scheduler of the study is gone"."""
    file = StudyFile.create(tmp_path / "x.zarr", {"x": Column("", "x", (), np.arange(CASES))}, CASES, BATCH, {})
    pool = Pool(lambda job: [outcome(row["x"]) for row in job.rows], [0, 1, 2, 3])
    monkeypatch.setattr(distributed, "as_completed", lambda loop: pool)
    monkeypatch.setattr(study_module, "client_of", lambda *_: nullcontext(pool))

    class Full:
        def __setitem__(self, where: object, values: object) -> None:
            raise OSError(errno.ENOSPC, "No space left on device")

    file._arrays["status"] = Full()
    cases: Any = SimpleNamespace(base={}, keys={}, rows=[{"x": x} for x in range(CASES)], static=False)
    with pytest.raises(ResultError, match=r"cannot be written\n.*No space"):
        study_module.compute_open_batches(file, cases, {}, None, None, None)


@pytest.mark.parametrize("deadly", [0, 5])
def test_cases_of_a_worker_that_died_are_computed_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, deadly: int
) -> None:
    """While one of them runs nothing else does, because dask would count its death against the others as well."""

    def compute(job: Job) -> list[Outcome]:
        if deadly in [row["x"] for row in job.rows]:
            raise distributed.KilledWorker("task", None, 3)
        return [outcome(row["x"]) for row in job.rows]

    pool = Pool(compute, [2, 3, 0, 1])
    file = computed(tmp_path / "x.zarr", pool, monkeypatch)
    assert np.flatnonzero(file.status == FAILED).tolist() == [deadly] and (file.status != 0).all()
    assert pool.alone == [1, 1]
    assert values(file, "s").tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("batch", [1, 2, 4])
def test_what_a_batch_is_decides_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, batch: int) -> None:
    """What case 0 lacks ends the study, and what others lack does not, however many cases share its batch."""
    monkeypatch.setattr("test_dispatch.BATCH", batch)

    def lacking(*cases: int) -> Pool:
        def compute(job: Job) -> list[Outcome]:
            rows = [outcome(row["x"]) for row in job.rows]
            return [
                one._replace(absent="no such") if row["x"] in cases else one
                for one, row in zip(rows, job.rows, strict=True)
            ]

        return Pool(compute, list(range(CASES)))

    with pytest.raises(ResultError, match="no such"):
        computed(tmp_path / "first.zarr", lacking(0), monkeypatch)
    assert (computed(tmp_path / "rest.zarr", lacking(*range(1, CASES)), monkeypatch).status == DONE).all()


def test_a_study_is_opened_while_a_file_of_it_is_written(tmp_path: Path) -> None:
    """What a writer has begun, or a killed one has left, is passed over without a warning, and is written anew."""
    column = Column("", "", (), np.arange(CASES, dtype=float))
    file = StudyFile.create(tmp_path / "s.zarr", {"x": column}, CASES, BATCH, {"variables": '["x"]'})
    (tmp_path / "s.zarr" / "zarr.8c1e87.partial").write_bytes(b"{")
    (tmp_path / "s.zarr" / "force_max").mkdir()
    again = StudyFile(tmp_path / "s.zarr")
    assert np.array_equal(again.status, file.status) and "force_max" not in again
    assert "force_max" not in open_study(tmp_path / "s.zarr")
    ones = np.ones(BATCH)
    again.add(0, {"force_max": Column("N", "", (), ones), "status": Column("", "", (), DONE * ones)}, {})
    assert np.array_equal(open_study(tmp_path / "s.zarr").force_max[:BATCH], ones)
