"""How tests write the tables of a scene: its lines, what holds them, and other tables by their names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hybrid.scene.network import Network
from hybrid.scene.read import as_scene

Tables = dict[str, Any]
# What may be said without a table: cells; duration and step, s; interval of outputs, s, and how many points they have.
SHORT = {"mesh": ("cells",), "time": ("duration", "step", "rho_inf"), "output": ("every", "points")}
AROUND = ("gravity", "fluid", "seabed")


def in_tables(given: Tables) -> Tables:
    """Tables of which some are said by numbers, and parts of the environment by themselves."""
    scene: Tables = {}
    for key, x in given.items():
        if key in AROUND:
            scene.setdefault("environment", {})[key] = x
        elif key in SHORT and not isinstance(x, dict | None):
            scene[key] = dict(zip(SHORT[key], x if isinstance(x, tuple) else (x,), strict=False))
        else:
            scene[key] = x
    return scene


def pinned_at(x: float, y: float, z: float, **more: Any) -> Tables:
    """An end that is held and turns freely."""
    return {"kind": "pinned", "position": [x, y, z], **more}


def clamped_at(position: Sequence[float], tangent: Sequence[float], **more: Any) -> Tables:
    """An end that is held with its direction."""
    return {"kind": "clamped", "position": position, "tangent": tangent, **more}


def span(**tables: Any) -> Tables:
    """A catenary of 100 m over 80 m, of 10 cells, at rest; tables as in `in_tables`."""
    section = {"length": 100, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6}
    given = {"model": "catenary", "mesh": 10} | tables
    return cable_scene(section, pinned_at(0, 0, 0), pinned_at(80, 0, 0), **given)


def pulled(name: str, largest: float) -> Tables:
    """Outputs with a limit of the horizontal force at the end, N, by a name."""
    return {"quantities": {name: {"kind": "horizontal_force", "end": "end", "largest": largest}}}


def cable_scene(
    sections: Tables | list[Tables],
    start: Tables | str,
    end: Tables | str,
    *,
    attachments: Any = None,
    initial: Any = "equilibrium",
    **tables: Any,
) -> Tables:
    """A scene of a cable, which begins at rest where nothing else is said; tables as in `in_tables`."""
    cable: Tables = {"sections": [sections] if isinstance(sections, dict) else sections}
    if attachments is not None:
        cable["attachments"] = attachments
    ends = {"start": start, "end": end}
    return {"cable": cable, "ends": ends} | ({"initial": initial} if initial else {}) | in_tables(tables)


def network_scene(points: Tables, lines: Tables, **tables: Any) -> Tables:
    """A scene of lines between points; tables as in `in_tables`."""
    return {"points": points, "lines": lines} | in_tables(tables)


def line_between(start: str, end: str, sections: Tables | list[Tables], **tables: Any) -> Tables:
    """A line of a network; tables as in `in_tables`."""
    own = [sections] if isinstance(sections, dict) else sections
    return {"start": start, "end": end, "sections": own} | in_tables(tables)


def each_line(tables: Tables, **given: Any) -> Tables:
    """The scene of a network with these tables, as in `in_tables`, in each of its lines."""
    return tables | {"lines": {name: line | in_tables(given) for name, line in tables["lines"].items()}}


def system_of(tables: Tables) -> Network:
    """The scene of a network, validated."""
    found = as_scene(tables)
    assert isinstance(found, Network)
    return found
