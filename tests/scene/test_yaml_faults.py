"""Texts that are not YAML: the fault is named at the line that has to be changed, not at the one that cannot be read."""

from __future__ import annotations

import pytest
from scene_texts import complaints

from hybrid.errors import SceneError
from hybrid.scene.read import parse_scene

TEXT = """\
title: A line
environment:
  seabed: {z: -20, stiffness: 2.0e+3}
cable:
  sections:
    - {length: 30, mass: 2.0}
    - length: 30
      mass: 2.0
ends:
  start: {kind: pinned, position: [0, 0, -20]}
  end: {kind: pinned, position: [14, 0, 0]}   # held

initial: equilibrium
model: catenary
mesh: {
  size: 2,
  grading: {
    fine: 1
  },
  near: [1, 2]
}
time: {duration: 4.0, step: 0.05}
"""
COLON = "colon and a space"
# What is written in place of what: the line that has to be changed, and words of the remedy or of what is wrong.
FAULTS = [
    # a key without its colon, or without a space behind it
    ("title: A", "title A", 1, COLON),
    ("environment:\n", "environment\n", 2, COLON),
    ("  sections:\n", "  sections\n", 5, COLON),
    ("- length: 30\n", "- length 30\n", 7, COLON),
    ("      mass: 2.0\n", "      mass 2.0\n", 8, COLON),
    ("ends:\n", "ends\n", 9, COLON),
    ("model: cat", "model:cat", 14, COLON),
    ("time: {", "time {", 22, COLON),
    ("model: catenary\n", "model: catenary\ncont\n", 15, COLON),
    ("step: 0.05}\n", "step: 0.05}\ncont", 23, COLON),
    # a bracket that is not closed, at the end of its line or of what it holds
    ("2.0e+3}", "2.0e+3", 3, "close it with }"),
    ("mass: 2.0}", "mass: 2.0", 6, "close it with }"),
    ("-20]}", "-20", 10, "close it with ]}"),
    ("position: [0, 0, -20]}", "position: [", 10, "close it with ]}"),
    ("0, 0]}   #", "0, 0]   #", 11, "close it with }"),
    ("0.05}\n", "0.05\n", 22, "close it with }"),
    ("0.05}\n", "0.05\n\n\n", 22, "close it with }"),
    ("  },\n", "", 18, "the bracket { of line 17"),
    ("2]\n}\n", "2]\n", 20, "the bracket { of line 15"),
    # brackets that do not fit
    ("-20]}", "-20}", 10, "put ] before it"),
    ("-20]}", "-20]]}", 10, "put } before it"),
    ("0.05}\n", "0.05}}\n", 22, "take the bracket out"),
    # commas
    ("size: 2,", "size: 2", 16, "no comma"),
    ("  },\n", "  }\n", 19, "no comma"),
    ("z: -20, ", "z: -20 ", 3, "comma"),
    # quotes
    ("title: A", "title: 'A", 1, "close it with '"),
    ("kind: pinned", 'kind: "pinned', 10, 'close it with "'),
    ("A line\nenvironment:\n", "'A line\nenvironment: 'x'\n", 1, "close it with '"),
    # colons in texts, characters, indentation
    ("A line", "A line: two", 1, "in quotes"),
    ("A line", "@A", 1, "in quotes"),
    ("  seabed", "\tseabed", 3, "not tabs"),
    ("  end:", "   end:", 11, "indentation"),
    # paths of Windows in double quotes
    ("A line", '"C:\\x.csv"', 1, "C:/folder/file.csv"),
    ("A line", '"C:\\data\\motion.csv"', 1, "in single quotes"),
    # a second document
    ("model: cat", "---\nmodel: cat", 14, "one scene to a file"),
    ("model: cat", "  model: cat", 14, "indentation"),
]


@pytest.mark.parametrize(("right", "wrong", "line", "words"), FAULTS)
def test_a_fault_is_named_at_the_line_to_change(right: str, wrong: str, line: int, words: str) -> None:
    assert right in TEXT
    for end in ("\n", "\r\n"):
        with pytest.raises(SceneError) as refused:
            parse_scene(TEXT.replace(right, wrong, 1).replace("\n", end))
        (found,) = refused.value.complaints
        assert found.line == line
        assert words in f"{found.expected} {found.fix}"


def test_a_path_of_windows_whose_name_begins_with_a_special_character() -> None:
    """`"C:\\new.csv"` is YAML: a line break in the middle."""
    motion = '-20], motion: {file: "C:\\new.csv"}}'
    (found, *_) = complaints(TEXT.split("mesh: {\n")[0].replace("-20]}", motion) + "time: {duration: 4.0}\n")
    assert found.where == "ends.start.motion.file" and "C:/folder/file.csv" in found.fix


@pytest.mark.parametrize(
    ("right", "wrong", "key", "written"),
    [
        ("z: -20", "z:-20", "environment.seabed.z", "z: -20"),
        ("length: 30, ", "length 30, ", "cable.sections[0].length", "length: 30"),
        ("kind: pinned", "kind:pinned", "ends.start.kind", "kind: pinned"),
    ],
)
def test_a_key_without_colon_or_space_in_brackets_is_one_complaint(
    right: str, wrong: str, key: str, written: str
) -> None:
    sound = TEXT.split("mesh: {\n")[0] + TEXT.split("]\n}\n")[1]
    sound = sound.replace("mass: 2.0", "mass: 2.0, axial_stiffness: 1.0e+7", 1)
    sound = sound.replace("      mass: 2.0", "      mass: 2.0\n      axial_stiffness: 1.0e+7")
    assert complaints(sound) == []
    (found,) = complaints(sound.replace(right, wrong, 1))
    assert (found.where, found.line) == (key, sound[: sound.index(right)].count("\n") + 1)
    assert f"`{written}`" in found.fix
