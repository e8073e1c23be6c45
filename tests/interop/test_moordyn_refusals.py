"""What is wrong with a deck is said with its line, its value, what was expected and what to try; nothing else is raised."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from moordyn_decks import DECKS, from_text, one_scene, text_of

from hybrid.errors import SceneError
from hybrid.interop.moordyn import ImportedDeck, import_moordyn

CHAIN = "chain      0.05    20       2.0e8    0          0        1.2    1.0   0.05    0.0"
LEAD = "2    Coupled      205   0    -2     0      0       0      0 "
LINE = "1    chain      1        2        250       50       pt"

# What is changed in chain.txt, into what; the line that is named (None: the deck), what it is about, words of the fix.
CASES = {
    "no line types": ("- LINE TYPES -", "- SHIP TYPES -", None, "LINE TYPES", "MoorDyn input file"),
    "no lines": ("- LINES -", "- ROPES -", None, "LINES", "MoorDyn input file"),
    "no points": ("- POINTS -", "- PLACES -", 15, "point 1", "add its section, POINTS"),
    "misspelt line types": ("- LINE TYPES -", "- LINE TIPES -", 3, "LINE TYPES", "------- LINE TYPES"),
    "misspelt lines": ("- LINES -", "- LIMES -", 12, "LINES", "------- LINES"),
    "misspelt points": ("- POINTS -", "- PIONTS -", 7, "POINTS", "------- POINTS"),
    "misspelt options": ("- OPTIONS -", "- OPTOINS -", 16, "OPTIONS", "------- OPTIONS"),
    "a title without dashes": (f"{22 * '-'} LINES {48 * '-'}", "Lines", 12, "LINES", "------- LINES"),
    "an empty table": (f"{LINE}\n", "", 12, "LINES", "fill the table"),
    "a table twice": ("- OPTIONS -", "- LINES -", 16, "LINES", "together"),
    "no row of units": (
        "(name)     (m)     (kg/m)   (N)      (N-s/-)    (N-m^2)  (-)    (-)   (-)     (-)\n",
        "",
        5,
        "LINE TYPES",
        "both rows",
    ),
    "a column too few": (CHAIN, CHAIN[:-5], 6, "9 columns", ""),
    "a point without Ca": (LEAD, LEAD.rstrip()[:-1], 11, "8 columns", "write 0"),
    "a line without outputs": (LINE, LINE[:-2], 15, "6 columns", "write 0 where there is nothing, - where"),
    "an unknown type": (LINE, LINE.replace("chain", "chian"), 15, "line type", "did you mean chain?"),
    "an unknown attachment": (LEAD, LEAD.replace("Coupled", "Copled "), 11, "attachment", "did you mean Coupled?"),
    "an unknown point": (LINE, LINE.replace("2  ", "7  "), 15, "point 7", "columns"),
    "an unknown body": (LEAD, LEAD.replace("Coupled", "Body3  "), 11, "body 3", "BODIES"),
    "an unknown rod": (LINE, LINE.replace("2  ", "R1A"), 15, "rod 1", "RODS"),
    "a rod without its end": (LINE, LINE.replace("2  ", "R1 "), 15, "attachment", ""),
    "NaN": (CHAIN, CHAIN.replace("2.0e8", "NaN  "), 6, "EA (N)", "may have failed"),
    "infinite": (LEAD, LEAD.replace("205", "inf"), 11, "X", "may have failed"),
    "too large": (LEAD, LEAD.replace("205 ", "1e999"), 11, "X", "columns"),
    "a decimal comma": (CHAIN, CHAIN.replace("0.05 ", "0,05 ", 1), 6, "diameter (m)", "0.05"),
    "not a number": (LEAD, LEAD.replace("-2", "zz"), 11, "Z", "columns"),
    "no diameter": (CHAIN, CHAIN.replace("0.05 ", "0.0  ", 1), 6, "diameter (m)", "sign"),
    "a negative mass": (CHAIN, CHAIN.replace(" 20 ", "-20 "), 6, "mass per length (kg/m)", "sign"),
    "a negative drag": (CHAIN, CHAIN.replace("1.2", "-12"), 6, "Cd", "sign"),
    "a diameter in mm": (CHAIN, CHAIN.replace("0.05 ", "50.0 ", 1), 6, "diameter and mass", "mm?"),
    "a mass in t/m": (CHAIN, CHAIN.replace(" 20 ", "0.02"), 6, "diameter and mass", "kg/m"),
    "a mass in g/m": (CHAIN, CHAIN.replace(" 20   ", "20000 "), 6, "diameter and mass", "g/m"),
    "half a segment": (LINE, LINE.replace("50 ", "5.5"), 15, "NumSegs", ""),
    "no segments": (LINE, LINE.replace("50 ", "0  "), 15, "NumSegs", ""),
    "no length": (LINE, LINE.replace("250", "0  "), 15, "unstretched length (m)", ""),
    "too short": (LINE, LINE.replace("250", "100"), 15, "line1, as a scene: ends.end.position", "longer cable"),
    "IDs out of order": (LEAD, LEAD.replace("2   ", "3   ", 1), 11, "ID", "number the rows"),
    "an anchor under the bed": (
        "100      WtrDpth",
        "90       WtrDpth",
        15,
        "line1, as a scene: ends.start.position",
        "lower",
    ),
    "a negative depth": ("100      WtrDpth", "-100     WtrDpth", 22, "WtrDpth", "sign"),
    "water in t/m^3": ("1025     rho", "1.025    rho", 21, "density", "write 1025"),
    "gravity in cm/s^2": ("9.81     g", "981      g", 20, "gravity", "9.81"),
    "no gravity of a number": ("9.81     g", "earth    g", 20, "g", ""),
    "name before value": ("9.81     g", "g     9.81", 20, "g", "write 9.81 g"),
}


@pytest.mark.parametrize("case", CASES)
def test_a_refusal_has_line_value_expectation_and_fix(case: str, tmp_path: Path) -> None:
    old, new, line, where, fix = CASES[case]
    text = text_of("chain")
    assert text.count(old) == 1, "the case changes one place"
    with pytest.raises(SceneError) as refused:
        from_text(text.replace(old, new), tmp_path)
    first = next((c for c in refused.value.complaints if c.where == where), None)
    assert first is not None, str(refused.value)
    assert first.line == line and first.value and first.expected
    assert fix in first.fix, first.fix
    assert refused.value.file.endswith("deck.txt")


# Decks that MoorDyn 2.7.2 reads: what is changed in chain.txt, into what, and words of the note.
READ = {
    "a remark behind a title": ("- LINE TYPES -", "- LINE TYPES chain of 50 mm -", ""),
    "a remark before a title": ("- LINES -", "- MOORING LINES -", ""),
    "columns of words": (CHAIN, CHAIN + " 0 0 0 lots of words", "of 16 columns the first 13"),
    "a column more of points": (LEAD, LEAD + "0", "of 10 columns the first 9"),
    "EA in GN": (CHAIN, CHAIN.replace("2.0e8", "0.2  "), "travels at 20 to 30000 m/s, sqrt(EA/m); here 0.1"),
    "E for EA": (CHAIN, CHAIN.replace("2.0e8 ", "2.0e11"), "implausible"),
    "as dense as no metal": (CHAIN, CHAIN.replace("0.05 ", "0.02 ", 1), "6.37e+04 kg/m^3"),
    "columns of CableDyn": ("Cd     Ca    CdAx    CaAx", "Cd     CdAx  Ca      CaAx", "column 8, CdAx, is read as Ca"),
    "two columns exchanged": (
        "Cd     Ca    CdAx    CaAx", "Ca     Cd    CdAx    CaAx Cl dF cF", "column 7, Ca, is read as Cd",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", READ)
def test_what_moordyn_reads_by_place_is_read_with_a_note(case: str, tmp_path: Path) -> None:
    old, new, why = READ[case]
    text = text_of("chain")
    assert text.count(old) == 1, "the case changes one place"
    was, made = from_text(text, tmp_path), from_text(text.replace(old, new), tmp_path)
    (one,), (other,) = was.scenes.values(), made.scenes.values()
    added = [note.why for note in (*made.notes, *other.notes) if note not in (*was.notes, *one.notes)]
    assert any(why in text for text in added) if why else not added
    if not why or why.startswith("of "):
        assert other.text == one.text, "what is added says nothing"


def test_a_line_between_ends_that_stretch_it_has_the_strain_that_it_needs(tmp_path: Path) -> None:
    nylon = text_of("chain").replace(CHAIN, CHAIN.replace("0.05    20       2.0e8", "0.1 7.9 2.0e6"))
    (made,) = from_text(nylon.replace(LINE, LINE.replace("250", "200")), tmp_path).scenes.values()
    assert made.scene.cable.sections[0].max_strain == 0.14  # 227.2 m apart, and its weight
    assert any("max_strain" in note.why for note in made.notes)


def test_a_body_with_one_moment_of_inertia_has_it_about_all_axes(tmp_path: Path) -> None:
    row = "1 Free 0 0 -5 0 0 0 1000 0 500|0|0 60 0 0"
    deck = RING.replace("--- POINTS", f"--- BODIES ---\nn\nu\n{row}\n--- POINTS")
    deck = deck.replace("1 Free 0 0 -10", "1 Fixed 0 0 -10").replace("2 Free 9 0 -10 1", "2 Body1 1 0 0 0")
    made = one_scene(deck, tmp_path)
    assert made.scene.bodies["body1"].inertia == (500.0, 500.0, 500.0)
    assert any("no moment of inertia about some axes" in note.why for note in made.notes)


def test_all_mistakes_are_told_at_once_in_order(tmp_path: Path) -> None:
    text = text_of("chain").replace("-2     0 ", "zz     0 ").replace("2.0e8", "nan").replace("50       pt", "x  pt")
    with pytest.raises(SceneError) as refused:
        from_text(text, tmp_path)
    assert [c.line for c in refused.value.complaints] == [6, 11, 15]


def test_a_deck_of_which_nothing_can_be_carried_over_is_refused(tmp_path: Path) -> None:
    text = text_of("chain").replace("2.0e8 ", "ea.dat")
    with pytest.raises(SceneError) as refused:
        from_text(text, tmp_path)
    (complaint,) = refused.value.complaints
    assert complaint.line == 15 and "ea.dat" in complaint.expected and "EA as a number" in complaint.fix


RING = """\
--- LINE TYPES ---
n
u
wire 0.03 3.5 4.0e7 0 0 1.2 1.0 0.01 0.0
--- POINTS ---
n
u
1 Free 0 0 -10 1 0 0 0
2 Free 9 0 -10 1 0 0 0
--- LINES ---
n
u
1 wire 1 2 10 5 -
2 wire 2 1 10 5 -
--- OPTIONS ---
50 WtrDpth
--- need this line ---
"""


@pytest.mark.parametrize("rows", ["", "one"])
def test_a_ring_has_no_ends(rows: str, tmp_path: Path) -> None:
    text = RING if not rows else RING.replace("2 wire 2 1 10 5 -\n", "").replace("1 wire 1 2", "1 wire 1 1")
    with pytest.raises(SceneError, match="ring of free points"):
        from_text(text, tmp_path)


@pytest.mark.parametrize("path", ["not there.txt", ".", "a\0b"])
def test_what_cannot_be_read(path: str) -> None:
    with pytest.raises(SceneError, match="exists and can be read"):
        import_moordyn(path)


def test_a_line_that_is_not_there() -> None:
    from moordyn_decks import imported

    with pytest.raises(SceneError, match="a line of the deck: 1, 2, 3"):
        imported("three_lines", 4)
    with pytest.raises(SceneError, match=r"EA is not one number"):
        imported("rods_and_bodies", 4)


# --- mutated decks -----------------------------------------------------------------------------

TEXTS = [text_of(name) for name in DECKS]
ODD = [
    "",
    "-",
    "---",
    "NaN",
    "-1",
    "0",
    "1e400",
    "1|2",
    "R1A",
    "Body1",
    "Free",
    "#",
    "\0",
    "\u2028",
    "é",
    "x" * 300,
    "1_0",
    "²",
    "'",
]
words = st.one_of(st.sampled_from(ODD), st.text(max_size=12), st.floats().map(str), st.integers().map(str))


@st.composite
def mutated(draw: st.DrawFn, texts: Sequence[str] = TEXTS) -> str:
    """A deck with cells, rows and characters changed, dropped, doubled and swapped."""
    rows = [row.split(" ") for row in draw(st.sampled_from(texts)).split("\n")]
    for _ in range(draw(st.integers(1, 6))):
        i = draw(st.integers(0, len(rows) - 1))
        full = [j for j, cell in enumerate(rows[i]) if cell] or [0]
        how = draw(st.sampled_from(["cell", "drop cell", "drop row", "double row", "swap rows", "insert", "cut"]))
        if how == "cell":
            rows[i][draw(st.sampled_from(full))] = draw(words)
        elif how == "drop cell":
            del rows[i][draw(st.sampled_from(full))]
        elif how == "drop row" and len(rows) > 1:
            del rows[i]
        elif how == "double row":
            rows.insert(i, list(rows[i]))
        elif how == "swap rows":
            j = draw(st.integers(0, len(rows) - 1))
            rows[i], rows[j] = rows[j], rows[i]
        elif how == "insert":
            rows.insert(i, [draw(words)])
        elif how == "cut":
            del rows[max(i, 1) :]
        rows[-1] = rows[-1] or [""]
        rows = [row or [""] for row in rows]
    return "\n".join(" ".join(row) for row in rows)


def imports_or_refuses(text: str, folder: Path) -> ImportedDeck | SceneError:
    try:
        return from_text(text, folder)
    except SceneError as error:
        return error


@pytest.mark.long
@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mutated())
def test_a_mutated_deck_is_imported_or_refused_with_its_line(tmp_path: Path, text: str) -> None:
    found = imports_or_refuses(text, tmp_path)
    if isinstance(found, SceneError):
        count = text.count("\n") + text.count("\r") + 1
        assert found.complaints
        assert all(c.expected and (c.line is None or 1 <= c.line <= count) for c in found.complaints)
        assert all(c.line is not None for c in found.complaints if c.where not in ("LINE TYPES", "LINES"))
    else:
        assert found.scenes and all(scene.text.isprintable() or "\n" in scene.text for scene in found.scenes.values())


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=400))
def test_no_deck_at_all_is_refused(tmp_path: Path, raw: bytes) -> None:
    (tmp_path / "deck.txt").write_bytes(raw)
    with pytest.raises(SceneError):
        import_moordyn(tmp_path / "deck.txt")
