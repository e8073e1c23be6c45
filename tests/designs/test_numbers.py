"""Numbers of scenes: what is put in place of them is what reading the scene with them gives."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from hybrid.designs.numbers import allowed, changed_scene, number_of, with_number
from hybrid.errors import SceneError
from hybrid.scene.base import Invalid
from hybrid.scene.read import as_scene

EXAMPLES = Path(__file__).parents[2] / "examples"


def keys(tables: object, path: str = "") -> Iterator[str]:
    if isinstance(tables, Mapping):
        for name, x in tables.items():
            yield from keys(x, f"{path}.{name}".lstrip("."))
    elif isinstance(tables, list | tuple):
        for k, x in enumerate(tables):
            yield from keys(x, f"{path}[{k}]")
    elif isinstance(tables, float):
        yield path


@pytest.mark.parametrize("name", ["touchdown", "laying", "s_tether", "irregular_sea", "rov_descent"])
def test_a_number_put_in_place_is_as_read(name):
    scene, same = as_scene(EXAMPLES / f"{name}.yaml"), 0
    for key in keys(scene.model_dump(mode="python")):
        number = number_of(scene, key) * (1.0 + 1e-5)
        try:
            read = changed_scene(scene, key, number)
        except SceneError:
            with pytest.raises(Invalid):
                allowed(with_number(scene, key, number))
            continue
        changed = with_number(scene, key, number)
        assert allowed(changed) == read and number_of(changed, key) == number, key
        same += 1
    assert same > 10


def test_what_does_not_match_is_not_allowed():
    scene = as_scene(EXAMPLES / "03_suspension_rod.yaml")
    with pytest.raises(Invalid):
        allowed(with_number(scene, "cable.sections[0].mass", -1.0))


@pytest.mark.parametrize("place", ["-1", "00", "1"])
def test_an_item_is_counted_from_the_start(place):
    """An item of a list written in another way would be none of the scene, and nothing would depend on it."""
    scene = as_scene(EXAMPLES / "03_suspension_rod.yaml")
    with pytest.raises(SceneError, match="a key of the scene that has a number"):
        number_of(scene, f"cable.sections[{place}].mass")


def test_a_number_of_things_is_none_to_differentiate_by():
    """Whole numbers, such as the seed of a sea, have no neighbours; numbers that are written without a point have."""
    scene = as_scene(EXAMPLES / "irregular_sea.yaml")
    for key in ("environment.fluid.waves.seed", "environment.fluid.waves.components"):
        with pytest.raises(SceneError, match="may change by a little"):
            number_of(scene, key)
    assert number_of(scene, "ends.start.position[0]") == scene.ends.start.position[0]
