"""Surfaces of triangles for tests: corners (F, 3, 3), m, counter-clockwise from outside, and files of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

Array = np.ndarray


def box(size: tuple[float, float, float]) -> Array:
    """A box about the origin as 12 triangles."""
    found = []
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        for side in (-1.0, 1.0):
            corners = np.zeros((4, 3))
            corners[:, axis] = side
            corners[:, a], corners[:, b] = (-1, 1, 1, -1), (-1, -1, 1, 1)
            corners = corners[:: int(side)]
            found += [corners[[0, 1, 2]], corners[[0, 2, 3]]]
    return np.array(found) * np.array(size) / 2.0


def prism(radius: float, sides: int, length: float, turn: float = 0.0) -> Array:
    """A prism about the y axis, whose sides touch a cylinder of a radius from outside, the first at an angle (rad)."""
    angle = turn + (np.arange(sides) + 0.5) * 2.0 * np.pi / sides
    out = radius / np.cos(np.pi / sides)
    low = np.column_stack([out * np.cos(angle), np.full(sides, -0.5 * length), out * np.sin(angle)])
    high = low + np.array([0.0, length, 0.0])
    found = []
    for k in range(sides):
        j = (k + 1) % sides
        found += [[low[k], high[j], low[j]], [low[k], high[k], high[j]]]
        found += [[low[k], low[j], low.mean(axis=0)], [high[j], high[k], high.mean(axis=0)]]
    return np.array(found)


def sphere(radius: float, times: int) -> Array:
    """A sphere about the origin: an octahedron whose triangles are divided in four so many times."""
    x = np.array([[[a, 0, 0], [0, b, 0], [0, 0, c]] for a in (1, -1) for b in (1, -1) for c in (1, -1)], float)
    turned = np.linalg.det(x) < 0.0
    x[turned] = x[turned][:, ::-1]
    for _ in range(times):
        middle = 0.5 * (x + x[:, [1, 2, 0]])
        middle /= np.linalg.norm(middle, axis=2, keepdims=True)
        parts = [np.stack([x[:, k], middle[:, k], middle[:, (k + 2) % 3]], axis=1) for k in range(3)]
        x = np.concatenate([*parts, middle])
    return radius * x


def binary_stl(path: Path, corners: Array) -> str:
    """Write a binary STL file; its name."""
    rows = np.zeros(len(corners), dtype=[("n", "<f4", 3), ("x", "<f4", (3, 3)), ("more", "<u2")])
    rows["x"] = corners
    path.write_bytes(b"\0" * 80 + len(corners).to_bytes(4, "little") + rows.tobytes())
    return str(path)


def text_stl(path: Path, corners: Array) -> str:
    """Write an STL file as text, every digit of it; its name."""
    lines = ["solid test"]
    for facet in corners.tolist():
        lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {x!r} {y!r} {z!r}" for x, y, z in facet)]
        lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid test", ""]), encoding="utf-8")
    return str(path)
