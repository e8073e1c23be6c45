"""Texts that are hardly YAML, and bytes that are no text: refused with a place, soon, and within little memory."""

from __future__ import annotations

import random
import time
from pathlib import Path

import pytest
from harden_scenes import TESTS
from harden_verdict import Said, _bad_words, command, refused

GOOD = (TESTS.parent / "examples" / "touchdown.yaml").read_text(encoding="utf-8")
HEAD = "cable: {sections: [{length: 1, mass: 1}]}\nends: {start: {kind: pinned, position: [0, 0, 0]}, end: free}\n"
TAIL = "initial: equilibrium\n"
LAUGHS = "a: &a [x, x]\n" + "".join(
    f"{c}: &{c} [{', '.join([f'*{b}'] * 9)}]\n" for b, c in zip("abcdefghijklmn", "bcdefghijklmno", strict=True)
)
MERGES = "a: &a {x: 1}\n" + "".join(
    f"{c}: &{c} {{<<: [*{b}, *{b}], y{c}: [*{b}, *{b}, *{b}]}}\n"
    for b, c in zip("abcdefghijklmnopqrst", "bcdefghijklmnopqrstu", strict=True)
)

# What a text is, and whether it is accepted all the same.
TEXTS: dict[str, tuple[bytes, bool]] = {
    "nothing": (b"", False),
    "spaces": (b"  \n \n", False),
    "comments": (b"# nothing here\n", False),
    "a BOM": (b"\xef\xbb\xbf" + GOOD.encode(), True),
    "UTF-16": (GOOD.encode("utf-16"), False),
    "UTF-16 without BOM": (GOOD.encode("utf-16-le"), False),
    "Latin-1": (GOOD.replace("Mooring", "Ankertau f\u00fcr").encode("latin-1"), False),
    "CRLF": (GOOD.replace("\n", "\r\n").encode(), True),
    "old Macintosh lines": (GOOD.replace("\n", "\r").encode(), True),
    "NUL": (GOOD.replace("250", "2\0000").encode(), False),
    "an escape of the terminal": (GOOD.replace("title: ", "title: \x1b[31m").encode(), False),
    "tabs": (GOOD.replace("  fluid", "\tfluid").encode(), False),
    "a thousand lists in each other": ((HEAD + "title: " + "[" * 1000 + "]" * 1000).encode(), False),
    "a hundred thousand lists": ((HEAD + "title: " + "[" * 100_000).encode(), False),
    "a thousand tables in each other": ((HEAD + "".join(" " * k + "a:\n" for k in range(1000))).encode(), False),
    "a billion laughs": ((LAUGHS + HEAD + TAIL).encode(), False),
    "merges upon merges": ((MERGES + HEAD + TAIL).encode(), False),
    "an alias of itself": ((HEAD + TAIL + "title: &a [*a]\n").encode(), False),
    "an anchor twice": ((HEAD.replace("1,", "&a 1,") + TAIL + "title: &a x\n").encode(), False),
    "an alias of nothing": ((HEAD + TAIL + "title: *b\n").encode(), False),
    "a tag of Python": ((HEAD + TAIL + "title: !!python/object/apply:os.system [echo]\n").encode(), False),
    "a tag of its own": ((HEAD + TAIL + "title: !mine x\n").encode(), True),
    "a tag that does not fit": ((HEAD.replace("mass: 1", "mass: !!int x") + TAIL).encode(), False),
    "a date": ((HEAD.replace("mass: 1", "mass: 2001-12-14") + TAIL).encode(), False),
    "sexagesimal": ((HEAD.replace("mass: 1", "mass: 1:30") + TAIL).encode(), False),
    "octal of YAML 1.1": ((HEAD.replace("mass: 1", "mass: 017") + TAIL).encode(), True),
    "yes": ((HEAD + TAIL + "output: {criteria: yes}\n").encode(), False),
    "two documents": ((HEAD + TAIL + "---\n" + HEAD).encode(), False),
    "a directive": (("%YAML 1.1\n---\n" + HEAD + TAIL).encode(), True),
    "a set": ((HEAD + TAIL + "title: !!set {a, b}\n").encode(), False),
    "a table as key": ((HEAD + TAIL + "{a: 1}: 2\n").encode(), False),
    "a word": (b"nonsense\n", False),
    "a list": (b"- 1\n- 2\n", False),
    "ten megabytes of comments": (b"# " + b"x" * 10_000_000 + b"\n" + (HEAD + TAIL).encode(), False),
    "ten megabytes in a title": ((HEAD + TAIL + "title: " + "x" * 10_000_000 + "\n").encode(), False),
    "ten megabytes of points": ((HEAD + TAIL.replace("equilibrium", "") + "output: {points: [" + "0.5, " * 2_000_000 + "]}\n").encode(), False),
    "ten megabytes of keys": ((HEAD + TAIL + "".join(f"k{i}: {i}\n" for i in range(700_000))).encode(), False),
}  # fmt: skip
SOON = 10.0  # s of processor time: a reader that takes longer hangs


@pytest.fixture(autouse=True)
def nothing_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the reader that is attacked: plans without their first steps."""
    monkeypatch.setattr("hybrid.accuracy.run_forecast.is_warm", lambda *_: False)


def _read(content: bytes, name: str = "fuzz.yaml") -> tuple[Said, list[str]]:
    """What `hybrid plan` says of a file, and what is wrong with how it says it."""
    Path(name).write_bytes(content)
    said = command("plan", name, seconds=SOON)
    faults = list(_bad_words(said))
    if said.raised:
        return said, [*faults, said.raised]
    if said.code:
        whole = "a text file" in said.err or "a scene file of at most" in said.err  # which has no lines to point at
        faults += [x for x in refused(said, Path(name), False, []).faults if not (whole and "no file, line" in x)]
        faults += ["control characters"] if any(ord(c) < 32 and c != "\n" for c in said.err) else []
        faults += [f"{len(said.err)} characters of complaint"] if len(said.err) > 20_000 else []
    return said, faults


@pytest.mark.parametrize("name", TEXTS)
def test_texts_that_are_hardly_yaml(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    content, accepted = TEXTS[name]
    said, faults = _read(content)
    assert not faults, faults
    assert said.code == (0 if accepted else 1), said.err[:500]


def _spoilt(rng: random.Random, content: bytes) -> bytes:
    """Bytes flipped, cut, doubled or mixed with noise."""
    data, way = bytearray(content), rng.randrange(6)
    if way == 0:
        return bytes(rng.randbytes(rng.randrange(1, 400)))
    if way == 1:
        return bytes(data[: rng.randrange(len(data))])
    for _ in range(rng.choice([1, 1, 2, 5])):
        i = rng.randrange(len(data))
        if way == 2:
            data[i] = rng.randrange(256)
        elif way == 3:
            data[i : i + rng.randrange(1, 30)] = b""
        elif way == 4:
            data[i:i] = rng.choice(
                [
                    b"\t",
                    b": ",
                    b"- ",
                    b"&a ",
                    b"*a ",
                    b"{",
                    b"]",
                    b"|\n",
                    b"%",
                    b"!!x ",
                    b"'",
                    b'"',
                    b"\n",
                    b"\0",
                    b"---\n",
                    b"? ",
                    b"<<: ",
                ]
            )
        else:
            j = rng.randrange(len(data))
            data[i:i] = data[j : j + rng.randrange(1, 60)]
    return bytes(data)


def _fuzz(seeds: range) -> None:
    begin, codes, bad = time.perf_counter(), {0: 0, 1: 0}, []
    texts = [p.read_bytes() for p in sorted((TESTS.parent / "examples").glob("*.yaml"))]
    bare = [b"\n".join(line for line in text.splitlines() if not line.startswith(b"#")) for text in texts]
    for seed in seeds:
        rng = random.Random(seed)
        said, faults = _read(_spoilt(rng, rng.choice(bare)))
        codes[said.code] = codes.get(said.code, 0) + 1
        bad += [f"{seed}: {fault}" for fault in faults[:2]]
    print(
        f"\n{len(seeds)} spoilt texts in {time.perf_counter() - begin:.0f} s: {codes[0]} accepted, {codes[1]} refused, {len(bad)} with a fault"
    )
    assert not bad, "\n".join(bad[:20])
    assert codes[0] and codes[1] and set(codes) == {0, 1}


@pytest.mark.long
def test_spoilt_texts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    _fuzz(range(90_000, 90_150))


@pytest.mark.bench
def test_three_thousand_spoilt_texts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    _fuzz(range(3000))


# --- motion files ------------------------------------------------------------------------------

MOVED = """\
cable: {sections: [{length: 11, mass: 1, axial_stiffness: 1.0e5}]}
ends: {start: {kind: pinned, position: [0, 0, 0]}, end: {kind: pinned, position: [10, 0, 0], motion: {file: moved.csv}}}
initial: equilibrium
mesh: {cells: 10}
time: {duration: 0.4, step: 0.05}
"""
ROWS = "t,x,y,z\n" + "".join(f"{0.05 * k:.2f},{10 - 0.01 * (0.05 * k) ** 3:.9f},0,0\n" for k in range(20))


@pytest.mark.long
def test_motion_files_that_are_spoilt(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("moved.csv").write_text(ROWS)
    assert _read(MOVED.encode())[0].code == 0
    odd = [b"", b"\0" * 100, ROWS.encode("utf-16"), b"\xef\xbb\xbf" + ROWS.encode(), ROWS.replace("\n", "\r\n").encode(),
           ROWS.replace(",", ";").encode(), ROWS.replace(",", "\t").encode(), ROWS.replace("t,x", "t,t").encode(),
           ROWS.replace("t,x", "time,x").encode(), ROWS.replace("0.40", "nan").encode(), ROWS.replace("0.40", "inf").encode(),
           ROWS.replace("0.40", "1e999").encode(), ROWS.replace("10.0", "1e300").encode(), ROWS.replace(",0,0", ",0").encode(),
           ROWS.replace("9.99", "-9.99").encode(), ("t,x,y,z\n" * 50).encode(), ROWS.replace("0", "1").encode(),
           b"t,x,y,z\n" + b"0,10,0,0\n" * 400_000, b"t" * 10_000_000, (ROWS + '"' * 50).encode(), ROWS.encode()[:-30],
           b"t,x,y,z\n" + b"".join(b"%d,1e-320,0,0\n" % k for k in range(20)),
           b"t,x,y,z\n" + b"".join(b"1e-%d,10,0,0\n" % (320 - k) for k in range(20)),
           b"t,x,y,z\n" + b"".join(b"%de3000,10,0,0\n" % k for k in range(20))]  # fmt: skip
    bad, codes = [], {0: 0, 1: 0}
    for k in range(len(odd) + 200):
        rng = random.Random(k)
        Path("moved.csv").write_bytes(odd[k] if k < len(odd) else _spoilt(rng, ROWS.encode()))
        said, faults = _read(MOVED.encode())
        codes[said.code] = codes.get(said.code, 0) + 1
        bad += [f"{k}: {fault}" for fault in faults]
    print(f"\n{sum(codes.values())} spoilt motion files: {codes[0]} accepted, {codes[1]} refused, {len(bad)} faults")
    assert not bad, "\n".join(bad[:20])
    assert codes[0] and codes[1] and set(codes) == {0, 1}
