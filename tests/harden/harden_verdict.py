"""What the command line made of a scene: ran, refused, failed or foretold to be long; and every way in which that is not good.

A fault is a traceback, a warning, a result that is not whole, a refusal or failure that does not say where and why, or
a computation that takes much longer than its plan says.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import resource
import signal
import sys
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

import hybrid
from hybrid.cli.commands import main

# s of processor time that a plan may foretell of a run that is made; longer ones are not: their plan said how long.
LONGEST_PLANNED = 1.0
# s of processor time after which a command is stopped: a plan promises an order of magnitude, of a machine with one user.
LONGEST = 60.0
# Bytes of address space that a command may take beyond what the process has.
MEMORY = 4 * 2**30


class TooLong(BaseException):
    """A command was stopped.  No Exception: nothing in between may take it for its own."""


@dataclass
class Said:
    """Exit code and streams of a command; what it raised beyond SystemExit, and what it warned of."""

    code: int
    out: str
    err: str
    raised: str = ""
    warned: list[str] = field(default_factory=list)
    seconds: float = 0.0


@dataclass
class Verdict:
    """outcome: ran, refused, failed, long or late; cause: a word; faults: why that is not good."""

    outcome: str
    cause: str = ""
    faults: list[str] = field(default_factory=list)
    text: str = ""
    lines: list[int | None] = field(default_factory=list)
    seconds: float = 0.0


@contextlib.contextmanager
def _limits(seconds: float) -> Iterator[None]:
    def stop(*_: Any) -> None:
        raise TooLong

    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = signal.signal(signal.SIGPROF, stop)
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, hard))
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def command(*arguments: str, seconds: float = LONGEST) -> Said:
    """Run a command in this process, as `hybrid` would, with limits of time and memory."""
    out, err, raised, code = io.StringIO(), io.StringIO(), "", 0
    begin = time.perf_counter()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                with _limits(seconds):
                    main(list(arguments))
            except SystemExit as leaving:
                code = int(leaving.code or 0)
            except TooLong:
                raised = "too long"
            except BaseException as error:
                raised = f"{type(error).__name__}: {error}"
    spent = time.perf_counter() - begin
    return Said(code, out.getvalue(), err.getvalue(), raised, [str(w.message) for w in warned], spent)


def _message(said: Said, as_json: bool) -> str:
    """What was said of an error, as people read it."""
    if not as_json:
        return said.err
    errors = [json.loads(line) for line in said.out.splitlines() if '"event": "error"' in line]
    return "\n".join(error["message"] for error in errors)


def _bad_words(said: Said) -> Iterator[str]:
    if said.raised and said.raised != "too long":
        yield f"raised {said.raised}"
    for text in (said.out, said.err):
        if "Traceback" in text or "is a bug" in text:
            last = [
                line
                for line in text.replace("\\n", "\n").splitlines()
                if re.match(r"^\w[\w.]*(Error|Warning|Exception)\b", line)
            ]
            yield f"traceback: {last[-1] if last else text[-300:]}"
    for text in said.warned:
        yield f"warning: {text}"
    own = "\n".join(x for x in said.err.splitlines() if "given:" not in x)
    if re.search(r"Warning|\bnan\b|site-packages", own):
        yield "a warning, a NaN or a library's path in the text"


def judge(scene: Path, seed: int, static: bool = False) -> Verdict:
    """Plan a scene and, where the plan is short, compute it; `seed` picks JSON or text."""
    as_json = bool(seed % 2)
    flags = ["--json"] if as_json else []
    planned = command("plan", str(scene), "--json")
    faults = list(_bad_words(planned))
    if planned.raised == "too long":
        return Verdict("late", "plan", [*faults, "the plan takes too long"], planned.out + planned.err)
    if planned.code:
        said = planned if as_json else command("plan", str(scene))
        return refused(said, scene, as_json, [*faults, *_bad_words(said)])
    facts = json.loads(planned.out.splitlines()[-1])
    if not facts["steps"]:
        static = True
    if not static and facts["seconds"] > LONGEST_PLANNED:
        return Verdict("long", f"{facts['seconds']:.0e} s", faults)
    said = command("static" if static else "run", str(scene), "--output", str(scene.with_suffix(".h5")), *flags)
    faults += _bad_words(said)
    text = _message(said, as_json)
    if said.raised == "too long" and _advanced(scene.with_suffix(".h5")):
        return Verdict("slow", "", faults, seconds=said.seconds)
    if said.raised == "too long":
        told = [f"plan said {facts['seconds']:.2g} s and nothing came in {LONGEST:g} s"]
        return Verdict("late", "", faults + told, said.out[-500:] + said.err, seconds=said.seconds)
    if said.code == 1:
        verdict = refused(said, scene, as_json, faults)
    elif said.code == 2:
        verdict = failed(text, scene, static, faults)
    elif said.code == 0:
        verdict = Verdict(
            "ran", "static" if static else "", faults + list(not_whole(scene.with_suffix(".h5"))), said.err
        )
    else:
        verdict = Verdict("failed", "", [*faults, f"exit code {said.code}"], text)
    verdict.seconds = said.seconds
    return verdict


def _advanced(path: Path) -> bool:
    """Whether a run whose steps follow the motion was on its way, and its file is whole up to where it was stopped."""
    if not path.is_file():
        return False
    with hybrid.open(path) as result:
        follows = "step:" not in result.scene_text or "tolerance:" in result.scene_text
        return follows and result.status == "interrupted" and len(result["steps/t"]) > 0


def refused(said: Said, scene: Path, as_json: bool, faults: list[str]) -> Verdict:
    """Of every complaint: file, line, value, what was expected, and what to try."""
    text = _message(said, as_json).strip()
    blocks = re.split(r"\n(?=\S)", text)
    lines: list[int | None] = []
    causes = []
    for block in blocks:
        head, *rest = block.splitlines()
        names = {line[4:13].strip() for line in rest}
        found = re.match(rf"{re.escape(str(scene))}:(\d+):(\d+): (.*)", head)
        lines.append(int(found[1]) if found else None)
        causes.append(found[3] if found else head)
        if not found:
            faults.append(f"no file, line and column: {head}")
        faults += [f"no {name} {block!r}" for name in ("given:", "expected:", "try:") if name not in names]
    if said.code != 1:
        faults.append(f"exit code {said.code}")
    cause = re.sub(r"\[\d+\]", "", causes[0]).split(".")[0] if causes else ""
    return Verdict("refused", cause, faults, text, lines)


def failed(text: str, scene: Path, static: bool, faults: list[str]) -> Verdict:
    """Of a computation that stopped: place, cause, remedy, snapshot, and what is left."""
    cause = text.strip().splitlines()[0] if text.strip() else "nothing said"
    if not re.search(r"^    try:      \S", text, re.M):
        faults.append(f"no try: {text!r}")
    if not re.search(r" \((t = \S+ s(, s = \S+ m)?|s = \S+ m)\)$", cause):
        faults.append(f"no place: {cause}")
    if " (t = " in cause:
        snapshot = re.search(r"^    snapshot: (.*)", text, re.M)
        if not (snapshot and Path(snapshot[1]).is_file()):
            faults.append(f"no snapshot: {text!r}")
        with hybrid.open(scene.with_suffix(".h5")) as result:
            if result.status != "failed":
                faults.append(f"the file says {result.status}")
    return Verdict("failed", cause.split(" (")[0], faults, text)


def not_whole(path: Path) -> Iterator[str]:
    """What is wrong with a result that says it is complete."""
    with hybrid.open(path) as result:
        if result.status != "complete":
            yield f"status {result.status}"
        for name in result.names:
            values = np.asarray(result[name])
            if "payout/length" in result and name.startswith("envelope/") and result.dims(name):
                values = values[result["envelope/s"] <= result["payout/length"].max()]  # NaN: what was never out
            if (
                values.dtype.kind == "f"
                and not name.startswith(("touchdown", "events/", "self_distance/"))  # NaN: there is none
                and not np.isfinite(values).all()
            ):
                yield f"{name} is not finite"
        if len(result.times) == 0 or (np.diff(result.times) <= 0).any() or (np.diff(result.s) <= 0).any():
            yield "times or arc lengths do not increase"
        for zones in result.zones:
            edges = [x for zone in zones for x in (zone.s_a, zone.s_b)]
            if not zones or (np.diff(edges) < 0).any() or any(a.s_b != b.s_a for a, b in pairwise(zones)):
                yield f"zones do not fill the line: {zones}"
                break


if sys.platform != "linux":  # pragma: no cover
    raise ImportError("limits of memory are those of Linux")
