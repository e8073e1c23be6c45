"""Scenes made by five questions, and examples: all are read, and have an equilibrium."""

from __future__ import annotations

import random
import re

import pytest

import hybrid
from hybrid.live.document import Refused, example_text, examples, new_scene, questions
from hybrid.live.pictures import picture_of

KINDS = {x["kind"]: x["questions"] for x in questions()}


@pytest.mark.parametrize("kind", KINDS)
def test_the_usual_answers_make_a_scene_with_an_equilibrium_and_a_motion(kind: str) -> None:
    assert max(map(len, new_scene(kind, {}).splitlines())) <= 60, "lines that fit in the editor"
    text = new_scene(kind, {})
    picture, _ = picture_of(text, "", lambda: None)
    assert picture["problems"] == []
    assert picture["moves"]
    assert not [fact for fact in picture["facts"] if fact["weight"] == "alarm"]


@pytest.mark.parametrize("kind", KINDS)
def test_random_answers_make_a_scene_that_is_read_or_are_refused_in_words(kind: str) -> None:
    rng = random.Random(kind)
    made = 0
    for _ in range(40):
        answers = {}
        for question in KINDS[kind]:
            low = max(question["low"], 1e-3 * question["high"])
            answers[question["key"]] = float(f"{low * (question['high'] / low) ** rng.random():.3g}")
        try:
            text = new_scene(kind, answers)
        except Refused as refused:
            assert re.search("must|no number from|expected:", str(refused))
            continue
        hybrid.parse_scene(text)
        made += 1
    assert made > 5


@pytest.mark.parametrize(
    "answers", [{"depth": "deep"}, {"depth": -1}, {"depth": None}, {"depth": "nan"}, {"depth": [1]}]
)
def test_answers_that_are_no_numbers_are_refused(answers: dict) -> None:
    with pytest.raises(Refused, match="water depth"):
        new_scene("mooring", answers)


def test_examples_are_named_and_begin_scenes() -> None:
    found = examples()
    assert len(found) > 10
    assert all(len(x["text"]) > 20 for x in found)
    for one in found:
        hybrid.parse_scene(example_text(one["name"]))


@pytest.mark.parametrize("name", ["../pyproject", "/etc/passwd", "touchdown.yaml", "", "studies/x"])
def test_other_files_are_no_examples(name: str) -> None:
    with pytest.raises(Refused):
        example_text(name)
