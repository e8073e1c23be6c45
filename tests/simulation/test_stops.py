"""Stops of a run, and what is due at them."""

from __future__ import annotations

from hybrid.model.plan import SAME_STOP, falls_on

STEP = 0.05


class Counted(list[float]):
    """Times that count how often one is read."""

    reads = 0

    def __getitem__(self, k):
        self.reads += 1
        return super().__getitem__(k)

    def __iter__(self):
        for k in range(len(self)):
            yield self[k]


def test_a_stop_is_a_time_but_for_round_off() -> None:
    times, near = [0.1, 0.2, 0.3], SAME_STOP * STEP
    assert all(falls_on(x + d, times, STEP) for x in times for d in (0.0, 0.9 * near, -0.9 * near))
    assert not any(falls_on(x + d, times, STEP) for x in times for d in (1.1 * near, -1.1 * near, 0.05))
    assert not falls_on(0.1, [], STEP)


def test_many_times_are_not_all_read_at_every_stop() -> None:
    """A run of hours has 100 000 outputs: what it does at each must not grow with their number."""
    times = Counted([0.1 * k for k in range(100_000)])
    assert falls_on(7654.3, times, STEP) and times.reads < 30
