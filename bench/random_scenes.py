"""Seeded random scenes in which zones come and go."""

from __future__ import annotations

from typing import Any

import numpy as np

KINDS = ("span", "slack", "in_out", "touchdown", "float")


def random_scene(seed: int) -> tuple[str, dict[str, Any]]:
    """A kind and a scene: lengths over two decades, EI over four, loads and speeds to match; zones that move."""
    rng = np.random.default_rng(seed)
    kind = str(rng.choice(KINDS))
    L, w = float(10 ** rng.uniform(0.5, 2.3)), float(10 ** rng.uniform(-1, 1.5))
    mass = w / 9.81 * rng.uniform(1.0, 1.5)
    EI = float(w * L**3 * 10 ** rng.uniform(-6, -2))
    EA = float(w * L * 10 ** rng.uniform(3.5, 5.5)) if rng.random() < 0.8 else None
    section: dict[str, Any] = {
        "length": L, "mass": mass, "diameter": float(np.sqrt(4 * mass / np.pi / 3000)), "bending_stiffness": EI,
        "drag": {"normal": 1.2, "tangential": 0.05}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    if EA:
        section["axial_stiffness"] = EA
    current = [float(rng.uniform(-0.2, 0.2)), float(rng.uniform(-0.1, 0.1)), 0]
    around: dict[str, Any] = {"gravity": 9.81, "fluid": {"density": 1025, "current": current}}
    T, A = float(np.sqrt(L / 9.81) * rng.uniform(3, 8)), float(L * rng.uniform(0.005, 0.05))
    motion: dict[str, Any] = {
        "heave": {"amplitude": A, "period": T},
        "surge": {"amplitude": A * rng.uniform(0, 1), "period": T * 1.3},
        "ramp": 2 * T,
    }
    dt = T / float(rng.choice([40, 80]))
    spans = {
        "span": (0.7, 0.95),
        "slack": (0.2, 0.6),
        "in_out": (0.5, 0.8),
        "touchdown": (0.5, 0.8),
        "float": (0.4, 0.9),
    }
    span = {name: rng.uniform(*x) for name, x in spans.items()}[kind] * L
    one: list[float] = [0, 0, 0]
    two = [span, 0, float(rng.uniform(-0.2, 0.2) * L)]
    cable: dict[str, Any] = {"sections": [section]}
    if kind == "touchdown":
        depth = L * rng.uniform(0.2, 0.4)
        one, two = [0, 0, -depth], [float(min(span, 0.93 * np.sqrt(L**2 - depth**2))), 0, 0]
        k = w / (1e-2 * section["diameter"] + 1e-4 * L)
        around["seabed"] = {"z": -depth, "stiffness": float(k), "damping": float(5 * np.sqrt(k * mass))}
        if rng.random() < 0.5:
            around["seabed"]["friction"] = 0.4
    if kind == "float":
        cable["attachments"] = [
            {"kind": "float", "at": L * rng.uniform(0.3, 0.7), "buoyancy": w * L * rng.uniform(0.1, 0.6),
             "mass": mass * L * 0.05, "drag_area": 0.01 * L}
        ]  # fmt: skip
    if kind == "in_out":
        motion["travel"] = {"by": [float(-0.25 * L), 0, 0], "over": 2 * T, "begin": 2 * T}
    return kind, {
        "environment": around,
        "cable": cable,
        "ends": {
            "start": {"kind": "pinned", "position": one},
            "end": {"kind": "pinned", "position": two, "motion": motion},
        },
        "initial": {"kind": "equilibrium"},
        "model": {"kind": "adaptive", "tolerance": float(rng.choice([3e-3, 1e-3, 3e-4]))},
        "time": {"duration": 5 * T, "step": dt, "rho_inf": float(rng.choice([0.5, 0.8]))},
        "output": {"every": 5 * T / 40, "points": 51},
    }


def hanging_line(seed: int) -> dict[str, Any]:
    """A line at rest in air, clamped and pinned: lengths over two decades, bending layers over three."""
    rng = np.random.default_rng(seed)
    L, mass = float(10 ** rng.uniform(0, 2)), float(10 ** rng.uniform(-2, 0.5))
    EI = float(mass * 9.81 * L**3 * 10 ** rng.uniform(-8, -3))
    span, height, angle = L * rng.uniform(0.5, 0.95), L * rng.uniform(-0.2, 0.2), rng.uniform(-1.2, 1.2)
    tangent = [float(np.cos(angle)), 0.0, float(np.sin(angle))]
    return {
        "cable": {"sections": [{"length": L, "mass": mass, "bending_stiffness": EI}]},
        "ends": {
            "start": {"kind": "clamped", "position": [0, 0, 0], "tangent": tangent},
            "end": {"kind": "pinned", "position": [float(span), 0, float(height)]},
        },
        "initial": "equilibrium",
        "output": {"points": int(rng.choice([41, 101, 201]))},
    }


NETWORKS = ("buoy", "body", "riser", "bridle", "series")


def random_network(seed: int) -> tuple[str, dict[str, Any]]:
    """A kind and two to six lines at rest: chains, ropes and cables, some with floats on a part, as rods, catenaries
    and zones, that meet at knots, buoys and bodies, over a bed with and without friction, in a current."""
    return Network(np.random.default_rng(seed)).made()


def in_the_water(place: Any, bed: dict[str, Any]) -> list[float]:
    """A place (m) between the surface, z = 0, and a bed."""
    x, y, z = (float(a) for a in place)
    return [x, y, min(max(z, bed["z"] + bed["slope"][0] * x + bed["slope"][1] * y), 0.0)]


class Network:
    """What `random_network` is made of: draws points, bodies and lines into the tables of one scene."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.depth = float(10 ** rng.uniform(1.2, 2.2))
        self.points, self.lines, self.bodies = dict[str, Any](), dict[str, Any](), dict[str, Any]()
        self.places, self.weights = dict[str, Any](), dict[str, float]()  # first places, m; weights in water, N
        self.slope = [float(x) for x in rng.uniform(-0.1, 0.1, 2)] if rng.random() < 0.4 else [0.0, 0.0]

    def made(self) -> tuple[str, dict[str, Any]]:
        rng = self.rng
        kind = str(rng.choice(NETWORKS))
        getattr(self, f"_{kind}")()
        bed: dict[str, Any] = {"z": -self.depth, "stiffness": float(10 ** rng.uniform(3.0, 4.5)), "slope": self.slope}
        if rng.random() < 0.5:
            bed["friction"] = float(rng.uniform(0.2, 0.8))
        current = [float(x) for x in rng.uniform(-0.7, 0.7, 2)] if rng.random() < 0.6 else [0.0, 0.0]
        fluid = {"density": 1025, "surface": 0.0, "current": [*current, 0.0]}
        scene = {"environment": {"fluid": fluid, "seabed": bed}, "points": self.points, "lines": self.lines}
        return kind, scene | ({"bodies": self.bodies} if self.bodies else {})

    def fixed(self, name: str, x: float, y: float, z: float | None = None) -> str:
        """A point that is held, on the bed unless at a height z."""
        z = -self.depth + self.slope[0] * x + self.slope[1] * y if z is None else z
        self.places[name] = np.array([x, y, z])
        self.points[name] = {"position": [float(x), float(y), float(z)]}
        return name

    def free(self, name: str, x: float, y: float, z: float) -> str:
        """A point that is free, first looked for at up to a third of the depth from where its lines are made for."""
        self.places[name] = np.array([x, y, z])
        guess = self.places[name] + self.rng.uniform(-0.33, 0.33, 3) * self.depth * (self.rng.random() < 0.5)
        self.points[name] = {"initial_guess": in_the_water(guess, {"z": -self.depth, "slope": self.slope})}
        return name

    def floats(self, name: str, lifts: float) -> None:
        """Make a free point a buoy that lifts a multiple of the weight of its lines; a clump, where that is negative."""
        weight = max(sum(self.weights[x] for x, y in self.lines.items() if name in (y["start"], y["end"])), 100.0)
        buoyancy = lifts * weight
        mass = max(0.2 * abs(buoyancy), -1.15 * buoyancy) / 9.81
        volume = (buoyancy / 9.81 + mass) / 1025.0
        self.points[name] |= {"mass": float(mass), "volume": float(volume), "drag_area": float(volume ** (2.0 / 3.0))}
        if buoyancy > 0.0 and self.rng.random() < 0.5:
            self.points[name]["height"] = float(1.2 * volume ** (1.0 / 3.0))

    def line(self, name: str, start: str, end: str, kinds: tuple[str, ...] = ("chain", "rope", "cable")) -> None:
        """A line of 1.01 to 1.5 times the distance of its points; one in four has a part with floats."""
        rng = self.rng
        length = float(rng.uniform(1.01, 1.5)) * float(np.linalg.norm(self.places[start] - self.places[end]))
        kind, d = str(rng.choice(kinds)), float(10 ** rng.uniform(-1.6, -0.8))
        density, strain = {"chain": (4200.0, 2e-4), "rope": (1120.0, 1e-2), "cable": (2200.0, 1e-3)}[kind]
        section: dict[str, Any] = {
            "length": length, "diameter": d, "mass": density * np.pi / 4 * d**2,
            "axial_stiffness": 3e3 * np.pi / 4 * d**2 * 9.81 * max(length, 30.0) / strain,
            "drag": {"normal": 1.2, "tangential": 0.05},
        }  # fmt: skip
        stiff = kind == "cable"
        if stiff:
            section["bending_stiffness"] = section["mass"] * 9.81 * length**3 * float(10 ** rng.uniform(-6.5, -3.0))
        sections, wet = [section], (density - 1025.0) * np.pi / 4 * d**2 * 9.81
        weight = wet * length
        if rng.random() < 0.25:
            parts = rng.dirichlet([4.0, 2.0, 4.0]) * length
            wide, lift = d, wet * float(rng.uniform(1.2, 2.5))  # floats of 500 kg/m^3 around the line
            wide = float(np.sqrt(d**2 + lift / (525.0 * 9.81 * np.pi / 4)))
            light = section | {"diameter": wide, "mass": section["mass"] + 500.0 * np.pi / 4 * (wide**2 - d**2)}
            sections = [x | {"length": float(part)} for x, part in zip((section, light, section), parts, strict=True)]
            weight -= lift * float(parts[1])
        self.weights[name] = weight
        self.lines[name] = {
            "start": start,
            "end": end,
            "sections": sections,
            "mesh": {"cells": int(rng.integers(15, 61))},
        }
        if stiff and (draw := rng.random()) < 0.6:
            part = float(rng.uniform(0.2, 0.8)) * length
            zones = {"kind": "zones", "zones": [{"rod": part}, {"catenary": length - part}]}
            self.lines[name]["model"] = "rod" if draw < 0.4 else zones
        else:
            self.lines[name]["model"] = "catenary"

    def _around(self, count: int) -> list[tuple[float, float]]:
        """Places of anchors around the origin, m."""
        turn, far = self.rng.uniform(0, 2 * np.pi), self.depth * self.rng.uniform(0.6, 2.0)
        angles = turn + 2 * np.pi * (np.arange(count) + self.rng.uniform(-0.15, 0.15, count)) / count
        return [(float(far * np.cos(a)), float(far * np.sin(a))) for a in angles]

    def _vessel(self, name: str, far: float) -> str:
        angle = self.rng.uniform(0, 2 * np.pi)
        return self.fixed(name, far * self.depth * np.cos(angle), far * self.depth * np.sin(angle), 3.0)

    def _buoy(self) -> None:
        """A buoy on two to four legs, often with a hose to a vessel."""
        buoy = self.free("buoy", 0.0, 0.0, -float(self.rng.uniform(0.0, 0.6)) * self.depth)
        for k, (x, y) in enumerate(self._around(int(self.rng.integers(2, 5)))):
            self.line(f"leg{k}", self.fixed(f"a{k}", x, y), buoy)
        if self.rng.random() < 0.5:
            self.line("hose", buoy, self._vessel("vessel", float(self.rng.uniform(0.3, 1.5))))
        self.floats(buoy, float(self.rng.uniform(0.3, 3.0)))

    def _body(self) -> None:
        """A floating body on three or four legs, often with a hose to a vessel."""
        rng, anchors = self.rng, self._around(int(self.rng.integers(3, 5)))
        width = 0.05 * self.depth
        for k, (x, y) in enumerate(anchors):
            place = np.array([x, y, 0.0]) * width / np.hypot(x, y) - [0.0, 0.0, 0.3 * width]
            self.points[f"f{k}"], self.places[f"f{k}"] = {"body": "body", "place": place.tolist()}, place
            self.line(f"leg{k}", self.fixed(f"a{k}", x, y), f"f{k}")
        if rng.random() < 0.5:
            self.points["f"], self.places["f"] = {"body": "body", "place": [0.0, 0.0, width]}, np.array([0, 0, width])
            self.line("hose", "f", self._vessel("vessel", float(rng.uniform(0.3, 1.5))))
        weight = max(sum(self.weights.values()), 100.0) * float(rng.uniform(0.5, 4.0))
        mass = weight / 9.81
        heave = weight / (0.3 * width)
        self.bodies["body"] = {
            "initial_guess": [*(float(x) for x in rng.uniform(-0.2, 0.2, 2) * self.depth), 0.0], "mass": float(mass),
            "inertia": [float(0.4 * mass * width**2)] * 3, "centre": [0.0, 0.0, float(-0.2 * width)],
            "hydrostatics": {"heave": float(heave), "roll": float(0.25 * heave * width**2), "pitch": float(0.25 * heave * width**2)},
        }  # fmt: skip

    def _riser(self) -> None:
        """Two cables in a row from a vessel to the bed, with a tether to the knot or buoy between them."""
        z = -float(self.rng.uniform(0.3, 0.8)) * self.depth
        knot, far = self.free("knot", 0.6 * self.depth, 0.0, z), float(self.rng.uniform(1.5, 3.0)) * self.depth
        self.line("upper", self.fixed("vessel", 0.0, 0.0, 2.0), knot, ("cable", "rope"))
        self.line("lower", knot, self.fixed("end", far, 0.0), ("cable", "chain"))
        y = float(self.rng.uniform(-0.3, 0.3)) * self.depth
        self.line("tether", knot, self.fixed("weight", 0.7 * self.depth, y), ("rope", "chain"))
        if self.rng.random() < 0.7:
            self.floats(knot, float(self.rng.uniform(0.2, 2.0)))

    def _bridle(self) -> None:
        """Two to four lines from a vessel to a knot, from which a line goes to an anchor or to a clump that hangs."""
        wide, count = 0.2 * self.depth, int(self.rng.integers(2, 5))
        knot = self.free("knot", 0.5 * self.depth, 0.0, -0.4 * self.depth)
        for k in range(count):
            y = wide * (k - 0.5 * (count - 1))
            self.line(f"leg{k}", self.fixed(f"v{k}", 0.0, y, 2.0), knot)
        if self.rng.random() < 0.6:
            self.line("tow", knot, self.fixed("anchor", float(self.rng.uniform(0.8, 3.0)) * self.depth, 0.0))
            if self.rng.random() < 0.5:
                self.floats(knot, float(self.rng.uniform(-1.0, 1.0)))
        else:
            clump = self.free("clump", 0.5 * self.depth, 0.0, -0.7 * self.depth)
            self.line("pendant", knot, clump)
            self.floats(clump, -float(self.rng.uniform(0.5, 3.0)))

    def _series(self) -> None:
        """Buoys, knots and clumps in a row between an anchor and a vessel or another anchor, with legs to the bed."""
        rng, count = self.rng, int(self.rng.integers(1, 4))
        span, last = float(rng.uniform(1.0, 3.0)) * self.depth, self.fixed("a", 0.0, 0.0)
        for k in range(count):
            x = span * (k + 1) / (count + 1)
            here = self.free(f"p{k}", x, 0.0, -float(rng.uniform(0.2, 0.7)) * self.depth)
            self.line(f"l{k}", last, here)
            if rng.random() < 0.4:
                y = float(rng.choice([-0.6, 0.6])) * self.depth
                self.line(f"leg{k}", self.fixed(f"a{k}", x, y), here)
            last = here
        self.line("last", last, self.fixed("z", span, 0.0, 2.0 if rng.random() < 0.6 else None))
        for k in range(count):
            if rng.random() < 0.8:
                self.floats(f"p{k}", float(rng.uniform(-0.5, 2.0)))
