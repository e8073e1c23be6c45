"""A deck of MoorDyn 2 of what a result was computed from, so that anyone can compare.

hybrid                                  MoorDyn
section                                 line type; BA = damping.stiffness EA
where sections of a line meet           Free point; Free rod without length where both bend
clump, float, free point, body          Free point with M, V, CdA, Ca = added_mass / (rho V)
fixed point, pinned end                 Fixed point, Coupled if it moves
body, fairlead                          body, point on it
clamped end of a line that bends        Fixed or Coupled rod without length, along the tangent
surface                                 z = 0: all heights are shifted
seabed.stiffness, .damping              kBot, cBot, per diameter of the thickest line
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate, pairwise
from textwrap import shorten
from typing import Any

from hybrid.errors import Complaint, SceneError
from hybrid.interop.moordyn.tables import NEAR, body_row
from hybrid.scene.attachments import sphere_diameter
from hybrid.scene.cable import AddedMass, Drag, Section
from hybrid.scene.read import read_text

Triple = tuple[float, float, float]
NO_BED = 1e4  # m under the surface, where a scene has none
UNDER = 10.0  # m under the surface, where a scene has none
NO_DIAMETER = 0.01  # m, where a section has none and is in no fluid
# Time steps below the limits of stability of RK4, as parts of characteristic times of a segment:
STRETCH = 1.2  # of l/c; the limit is 1.4, 2.8 over the highest frequency of stretch, 2 c/l
BEND = 0.6  # of l^2 sqrt(m/EI); the limit is 0.7, 2.8 over the highest frequency of bending, 4/l^2 sqrt(EI/m)
DAMPED = 0.6  # of m l^2/BA; the limit is 0.7, 2.8 over the highest rate of its damper, 4 BA/(m l^2)
WRITTEN = "written by hybrid-cable"  # begins the second line, a comment: such a deck may be replaced
_TOP = (
    "--- LINE TYPES ---\nTypeName Diam Mass/m EA BA EI Cd Ca CdAx CaAx\n"
    "(-) (m) (kg/m) (N) (N-s) (N-m^2) (-) (-) (-) (-)\n"
)
_RODS = (
    "--- ROD TYPES ---\nTypeName Diam Mass/m Cd Ca CdEnd CaEnd\n(-) (m) (kg/m) (-) (-) (-) (-)\njoint 0.01 1 0 0 0 0\n"
    "--- RODS ---\nID RodType Attachment Xa Ya Za Xb Yb Zb NumSegs Outputs\n"
    "(#) (-) (-) (m) (m) (m) (m) (m) (m) (-) (-)\n"
)
_BODIES = (
    "--- BODIES ---\nID Attachment X0 Y0 Z0 r0 p0 y0 Mass CG I Volume CdA Ca\n"
    "(#) (-) (m) (m) (m) (deg) (deg) (deg) (kg) (m) (kg-m^2) (m^3) (m^2) (-)\n"
)
_POINTS = "--- POINTS ---\nID Attachment X Y Z M V CdA Ca\n(#) (-) (m) (m) (m) (kg) (m^3) (m^2) (-)\n"
_LINES = "--- LINES ---\nID LineType AttachA AttachB UnstrLen NumSegs Outputs\n(#) (-) (-) (-) (m) (-) (-)\n"
# What a deck has not along a line, and what to do.
_NO_POINTS = {
    "swivel": "make it a clump: lines of a deck have no torque",
    "modules": "give their mass, volume and drag to a section of that length",
    "bend_stiffener": "give its bending stiffness to short sections of that length",
    "bend_restrictor": "give its bending stiffness to short sections of that length",
}


@dataclass(frozen=True)
class WrittenDeck:
    """The text of a deck, and what it does not have of the scene."""

    text: str
    notes: tuple[str, ...]


@dataclass
class _Shape:
    """Where a line is at the first output: s (m) and positions there (m); and its nodes (m)."""

    s: Sequence[float]
    places: Sequence[Sequence[float]]
    nodes: Sequence[float]

    def place_at(self, s: float) -> Triple:
        k = max(i for i in range(len(self.s)) if i == 0 or self.s[i] <= s)
        k = min(k, len(self.s) - 2)
        part = (s - self.s[k]) / (self.s[k + 1] - self.s[k])
        a, b = self.places[k], self.places[k + 1]
        x, y, z = (float(p + part * (q - p)) for p, q in zip(a, b, strict=True))
        return x, y, z

    def place_of(self, end: str) -> Triple:
        """Of an end; what is on a winch is where the winch is."""
        x, y, z = self.places[0 if end == "start" else -1]
        return x, y, z

    def cells(self, a: float, b: float) -> int:
        """Cells between two arc lengths, at least one."""
        near = 1e-6 * (b - a)
        return 1 + sum(a + near < s < b - near for s in self.nodes)


def deck_of(result: Any) -> WrittenDeck:
    """The deck of the scene of a result, its free points where the result has them first.

    SceneError, with every complaint, if the scene has what MoorDyn has not.
    """
    scene, _ = read_text(result.scene_text)
    form, lines = scene.form, result.lines or {"": result}
    shapes = {name: _shape(lines[called]) for name, called in form.names.items()}
    for name, shape in shapes.items():
        length = scene.lines[name].cable.length
        if shape.s[0] > 0.0 or shape.s[-1] < length * (1.0 - 1e-9):
            expected, fix = "both ends of the line among the points, where a deck holds it", f"add 0 and {length:g}"
            given = f"points from {shape.s[0]:g} to {shape.s[-1]:g} m"
            raise SceneError([Complaint(form.text(f"output.points.{name}"), given, expected, fix)])
    writer = _Writer(scene, shapes)
    for name in scene.bodies:
        place, turned = (result[f"bodies/{name}/{key}"][0].tolist() for key in ("position", "rotation"))
        writer.add_body(name, place, turned)
    text = writer.text()
    if writer.complaints:
        found = [replace(x, where=form.text(x.where)) for x in writer.complaints]
        raise SceneError(list(dict.fromkeys(found)), shorten(scene.title, 60, placeholder=" …"))
    return WrittenDeck(text, tuple(dict.fromkeys(map(form.text, writer.notes))))


def _shape(result: Any) -> _Shape:
    return _Shape(result.s.tolist(), result["position"][0].tolist(), result["mesh/s"][:].reshape(-1).tolist())


@dataclass
class _Lump:
    """What is at a point: kg, m^3, m^2, kg."""

    mass: float = 0.0
    volume: float = 0.0
    drag_area: float = 0.0
    added_mass: float = 0.0
    height: float = 0.0  # m

    def add(self, item: Any, volume: float) -> None:
        self.height = max(self.height, item.height or sphere_diameter(volume))
        self.mass += item.mass
        self.volume += volume
        self.drag_area += item.drag_area
        self.added_mass += item.added_mass


@dataclass
class _Writer:
    """Rows of the tables of a deck."""

    scene: Any
    shapes: dict[str, _Shape]
    types: dict[tuple[float, ...], str] = field(default_factory=dict)
    bodies: dict[str, str] = field(default_factory=dict)  # rows by name
    rods: list[str] = field(default_factory=list)
    points: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    names: list[str] = field(default_factory=list)  # which point or rod is what, for people
    steps: list[float] = field(default_factory=list)
    widths: list[tuple[float, float]] = field(default_factory=list)  # m, of pieces; and the height of their lower end
    notes: list[str] = field(default_factory=list)
    complaints: list[Complaint] = field(default_factory=list)

    def __post_init__(self) -> None:
        environment = self.scene.environment
        self.fluid = environment.fluid
        self.density = self.fluid.density if self.fluid is not None else 0.0
        highest = max(z for shape in self.shapes.values() for _, _, z in shape.places)
        surface = self.fluid.surface if self.fluid is not None else None
        self.surface = surface if surface is not None else highest + UNDER

    def text(self) -> str:
        self._sea()
        made = {name: self._free_or_fixed(name) for name in self.scene.points}
        for name, line in self.scene.lines.items():
            self._line(f"lines.{name}", name, line.cable, self._joined_ends(name, line, made))
        types = "".join(f"{name} {' '.join(map(_number, values))}\n" for values, name in self.types.items())
        numbered = "".join(f"{i} {row}\n" for i, row in enumerate(self.bodies.values(), 1))
        bodies = _BODIES + numbered if self.bodies else ""
        rods = _RODS + "".join(f"{i} {row}\n" for i, row in enumerate(self.rods, 1)) if self.rods else ""
        points = _POINTS + "".join(f"{i} {row}\n" for i, row in enumerate(self.points, 1))
        lines = _LINES + "".join(f"{i} {row} -\n" for i, row in enumerate(self.lines, 1))
        options = "--- OPTIONS ---\n" + "".join(f"{_number(v)} {k}\n" for k, v in self._options()) + "RK4 tScheme\n"
        title = f"{' '.join(self.scene.title.split()) or 'a scene of hybrid'}\n".replace("---", "-")
        tables = f"{_TOP}{types}{bodies}{rods}{points}{lines}{options}"
        return f"{title}{WRITTEN}: {'; '.join(self.names)}\n{tables}--- need this line ---\n"

    # --- what surrounds ------------------------------------------------------------------------

    def _refuse(self, where: str, value: Any, expected: str, fix: str) -> None:
        self.complaints.append(Complaint(where, str(value), expected, fix))

    def _sea(self) -> None:
        fluid, bed = self.fluid, self.scene.environment.seabed
        if fluid is not None and fluid.surface is None:
            self.notes.append(f"environment.fluid has no surface: MoorDyn's lies {UNDER:g} m above the line")
        if fluid is not None and fluid.flows():
            self.notes.append("environment.fluid.current is left out: MoorDyn reads currents from other files")
        if fluid is not None and fluid.waves is not None:
            self.notes.append("environment.fluid.waves is left out: MoorDyn reads waves from other files")
        touching, lines = self.scene.contact, self.scene.lines.values()
        if (touching is not None and touching.between != ()) or any(x.contact and x.contact.self for x in lines):
            self.notes.append("contact is left out: lines of the deck pass through themselves and each other")
        if bed is not None and bed.depths is not None:
            expected = (
                "a level bed: MoorDyn reads an uneven one from a file of its own, with straight lines between depths"
            )
            self._refuse("environment.seabed.depths", "a grid", expected, "give z alone, for a comparison")
        if bed is not None and bed.soil is not None:
            expected = "stiffness: a deck has no soil that remembers"
            self._refuse("environment.seabed.soil", "given", expected, "give stiffness, for a comparison")
        if bed is not None and bed.friction is not None and bed.friction.residual is not None:
            expected = "nothing: friction of a deck does not fall"
            self._refuse("environment.seabed.friction.residual", "given", expected, "leave it out, with breakout")
        if bed is not None and bed.slope is not None and any(bed.slope):
            expected = "a level bed, which a deck has"
            self._refuse("environment.seabed.slope", bed.slope, expected, "leave slope out, for a comparison")
        if given := ", ".join((*getattr(self.scene, "obstacles", ()), *getattr(self.scene, "shaped", ()))):
            self._refuse("obstacles", given, "none: a deck has no obstacles", "leave them out, for a comparison")

    def _options(self) -> Iterator[tuple[str, float]]:
        environment, bed = self.scene.environment, self.scene.environment.seabed
        depth = self.surface - bed.z if bed is not None else NO_BED
        several = len(self.scene.lines) > 1  # a deck of one chain of lines is read on the largest width
        near = [width for width, low in self.widths if several and low < self.surface - (1.0 - NEAR) * depth]
        width = max(near or [width for width, _ in self.widths], default=NO_DIAMETER)
        if bed is not None and any(x != width for x, _ in self.widths):
            self.notes.append(
                f"seabed.stiffness and .damping are taken on a width of {width:g} m; kBot acts on that of each line"
            )
        yield "g", environment.gravity
        yield "rho", self.density
        yield "WtrDpth", depth
        yield "kBot", bed.spring / width if bed is not None else 1.0
        yield "cBot", bed.damping / width if bed is not None else 0.0
        if bed is not None and bed.friction is not None:
            yield "MU_KA", bed.friction.axial
            yield "MU_KT", bed.friction.lateral
            self.notes.append("seabed.friction: MoorDyn's fades with the speed and holds nothing at rest")
        yield "dtM", float(f"{min(self.steps, default=1e-3):.2g}")
        yield "TmaxIC", 120.0

    # --- lines ---------------------------------------------------------------------------------

    def _joined_ends(self, name: str, line: Any, made: dict[str, str]) -> list[str]:
        """What a line is attached to at both ends: points, which are made."""
        if line.break_at is not None:
            self.notes.append(f"lines.{name}.break_at is left out")
        for end in ("start", "end"):
            if getattr(line.connections, end).payout is not None:
                at = f"lines.{name}.connections.{end}.payout"
                self.notes.append(f"{at} is left out: the line of the deck keeps its length at t = 0")
        return [self._joined(name, end, made[getattr(line, end)]) for end in ("start", "end")]

    def _joined(self, name: str, end: str, made: str) -> str:
        """What the end of a line is attached to: its point, which is made, or a rod that holds its direction there."""
        held = self.scene.clamp(name, end)
        if held is None or made == "0" or not self._bends(name, end):
            return made
        called = getattr(self.scene.lines[name], end)
        where, point = f"lines.{name}.connections.{end}", self.scene.points[called]
        if point.kind == "free" or held.bend_stiffness is not None:
            expected = "a clamp without a spring at a fixed point or a fairlead, because a deck has no others"
            self._refuse(where, "clamped", expected, "leave the clamp out, for a comparison")
            return made
        if not held.swivel:
            self.notes.append(f"{where} holds the twist; MoorDyn has none")
        if point.kind == "fixed":
            kind = "Coupled" if point.motion is not None else "Fixed"
            a = self._moved(self.shapes[name].place_of(end))
        else:
            kind, a = f"Body{1 + list(self.bodies).index(point.body)}", point.place
        rod = self._rod(kind, a, held.tangent, end)
        if not made:
            self.names.append(f"rod {rod[1:-1]}: {called}")
        return rod

    def _bends(self, name: str, end: str) -> bool:
        """Whether a line resists bending at an end."""
        return bool(self.scene.lines[name].sections[0 if end == "start" else -1].weakest_bending)

    def _rod(self, kind: str, a: Triple, tangent: Triple, end: str) -> str:
        """A rod without segments along a tangent, and its end that holds that end of a line."""
        size = math.hypot(*tangent)
        b = tuple(p + t / size for p, t in zip(a, tangent, strict=True))
        self.rods.append(f"joint {kind} {' '.join(map(_number, (*a, *b)))} 0 -")
        return f"R{len(self.rods)}{'B' if end == 'start' else 'A'}"

    def _line(self, where: str, name: str, cable: Any, ends: list[str]) -> None:
        """Lines of the deck between places where sections meet or something hangs; ends: where it begins and ends."""
        shape, bounds = self.shapes[name], [0.0, *accumulate(section.length for section in cable.sections)]
        kinds = [self._type(f"{where}.sections[{i}]", section) for i, section in enumerate(cable.sections)]
        hung = self._hung(f"{where}.attachments", cable, bounds)
        cuts = sorted({*bounds, *hung})
        at = ends[0]
        for a, b in pairwise(cuts):
            i = _section_at(bounds, a)
            ahead = behind = ends[1]
            if b != cuts[-1]:
                both = cable.sections[i], cable.sections[_section_at(bounds, b)]
                ahead, behind = self._joint(shape.place_at(b), hung.get(b), both, where)
            cells = shape.cells(a, b)
            self._step(cable.sections[i], (b - a) / cells)
            width = cable.sections[i].diameter or NO_DIAMETER
            self.widths.append((width, min(shape.place_at(a)[2], shape.place_at(b)[2])))
            self.lines.append(f"{kinds[i]} {at} {ahead} {_number(b - a)} {cells}")
            at = behind

    def _hung(self, where: str, cable: Any, bounds: Sequence[float]) -> dict[float, _Lump]:
        """What hangs on a line, by arc length; where sections meet, at just that."""
        found: dict[float, _Lump] = {}
        for i, item in enumerate(cable.attachments):
            if item.kind in _NO_POINTS:
                expected = "a clump or a float, which a deck has as points"
                self._refuse(f"{where}[{i}]", item.kind.replace("_", " "), expected, _NO_POINTS[item.kind])
                continue
            s = next((x for x in (*bounds, *found) if abs(x - item.at) <= 1e-9 * bounds[-1]), item.at)
            if s in (0.0, bounds[-1]):
                self._refuse(f"{where}[{i}]", f"at {s:g} m", "nothing at an end", "give it to the body or point there")
            volume = item.volume_in(self.density, self.scene.environment.gravity) if self.fluid is not None else 0.0
            found.setdefault(s, _Lump()).add(item, volume)
        return found

    def _joint(
        self, place: Triple, lump: _Lump | None, sections: tuple[Section, Section], where: str
    ) -> tuple[str, str]:
        """What ends one piece and begins the next."""
        both = all(section.weakest_bending for section in sections)
        if both and lump is None:
            x, y, z = self._moved(place)
            row = " ".join(map(_number, (x, y, z)))
            self.rods.append(f"joint Free {row} {row} 0 -")
            return f"R{len(self.rods)}A", f"R{len(self.rods)}B"
        if both:
            self.notes.append(f"{where}: the line turns freely where something hangs on it; in hybrid it bends through")
        point = self._point("Free", place, lump or _Lump())
        return point, point

    def _type(self, where: str, section: Section) -> str:
        if section.curve is not None:
            known = "syrope", "dynamic_stiffness", "creep", "tension_strain"
            key = next(x for x in known if getattr(section, x) is not None)
            fix = "give axial_stiffness alone, at the tension you expect"
            self._refuse(f"{where}.{key}", "given", "one stiffness, which this export writes", fix)
            return "none"
        if section.moment_curvature is not None:
            fix = "give bending_stiffness, at the curvature you expect"
            self._refuse(f"{where}.moment_curvature", "given", "one stiffness, which this export writes", fix)
            return "none"
        if section.bending_slip:
            self._refuse(f"{where}.bending_slip", "given", "nothing: this export writes one stiffness", "leave it out")
        if section.stiffness_per_tension:
            fix = "leave it out, and give the bending_stiffness at the tension you expect"
            self._refuse(f"{where}.stiffness_per_tension", "given", "nothing: this export writes one stiffness", fix)
        if section.tension_torque:
            expected = "nothing or 0, because MoorDyn has no torsion"
            self._refuse(f"{where}.tension_torque", section.tension_torque, expected, "leave it out, for a comparison")
        if section.axial_stiffness is None:
            expected = "a number, in N, because MoorDyn's lines are springs"
            self._refuse(
                f"{where}.axial_stiffness", "nothing", expected, "give axial_stiffness: 1000 times the tension is stiff"
            )
            return "none"
        if section.anisotropic or (section.intrinsic_curvature is not None and any(section.intrinsic_curvature)):
            expected = "a round, straight section, which MoorDyn's are"
            self._refuse(
                f"{where}.bending_stiffness", section.bending_stiffness, expected, "give one bending stiffness"
            )
        damping, drag, added = section.damped, section.drag or Drag(), section.added_mass or AddedMass()
        if damping.mass:
            self.notes.append(f"{where}.damping.mass is left out: MoorDyn has none")
        if section.vortices is not None:
            self.notes.append(f"{where}.vortices is left out: lines of the deck shed no vortices")
        if section.weakest_bending:
            self.notes.append("MoorDyn has no torsion")
        ba = damping.stiffness * section.axial_stiffness
        sizes = section.diameter or NO_DIAMETER, section.mass, section.axial_stiffness, ba
        values = (*sizes, section.weakest_bending or 0.0, drag.normal, added.normal, drag.tangential, added.tangential)
        return self.types.setdefault(values, f"type{len(self.types) + 1}")

    def _step(self, section: Section, l: float) -> None:
        """A time step with which MoorDyn is stable on segments of length l, m."""
        if section.axial_stiffness is None:
            return
        self.steps.append(STRETCH * l / math.sqrt(section.axial_stiffness / section.mass))
        if section.weakest_bending:
            self.steps.append(BEND * l * l / math.sqrt(section.weakest_bending / section.mass))
        if section.damped.stiffness:
            self.steps.append(DAMPED * section.mass * l * l / (section.damped.stiffness * section.axial_stiffness))

    def add_body(self, name: str, place: Triple, rotation: Triple) -> None:
        """A body of the scene, at its place (m) and rotation (deg)."""
        row, wrong = body_row(self.scene.bodies[name], place, rotation, self.density, self.surface)
        self.bodies[name] = row
        self.names.append(f"body {len(self.bodies)}: {name}")
        for key in wrong:
            expected = "nothing that a body of MoorDyn has not"
            self._refuse(f"bodies.{name}.{key}", key, expected, "leave it out, for a comparison")

    # --- points --------------------------------------------------------------------------------

    def _moved(self, place: Iterable[float]) -> Triple:
        x, y, z = place
        return x, y, z - self.surface

    def _point(self, kind: str, place: Triple, lump: _Lump) -> str:
        added = lump.added_mass / (self.density * lump.volume) if self.density and lump.volume else 0.0
        if lump.added_mass and not added:
            self.notes.append("added_mass of a point without volume is left out: MoorDyn's goes with the volume")
        if lump.volume and self._moved(place)[2] > -lump.height:
            self.notes.append("MoorDyn lifts a point at the surface by its whole volume; hybrid only where it is wet")
        row = (*self._moved(place), lump.mass, lump.volume, lump.drag_area, added)
        self.points.append(f"{kind} {' '.join(map(_number, row))}")
        return str(len(self.points))

    def _free_or_fixed(self, name: str) -> str:
        """What the deck has at a point; "": rods that hold the lines there, which come with them."""
        point = self.scene.points[name]
        line, end = self.scene.lines_at(name)[0]
        place = self.shapes[line].place_of(end)
        if getattr(point, "break_at", None) is not None:
            self.notes.append(f"points.{name}.break_at is left out")
        if point.kind == "guided":
            expected = "a pinned, clamped or free end, or a body"
            self._refuse(f"points.{name}", point.kind, expected, "MoorDyn has no guided ends")
            return "0"
        if point.kind == "fixed":
            here = self.scene.lines_at(name)
            if all(self.scene.clamp(*x) is not None and self._bends(*x) for x in here):
                return ""  # there are rods alone
            kind = "Coupled" if point.motion is not None else "Fixed"
            made = self._point(kind, place, _Lump())
        elif point.kind == "free":
            made = self._loose(f"points.{name}", point.end, place)
        else:
            row = (*point.place, 0.0, 0.0, 0.0, 0.0)
            self.points.append(f"Body{1 + list(self.bodies).index(point.body)} {' '.join(map(_number, row))}")
            made = str(len(self.points))
        self.names.append(f"point {made}: {name}")
        return made

    def _loose(self, where: str, end: Any, place: Triple) -> str:
        if end.loads:
            expected = "no force, because points of a deck have none"
            self._refuse(where, "force", expected, "leave the force out, for a comparison")
        lump = _Lump()
        if end.kind == "body":
            lump.add(end, end.volume if self.fluid is not None else 0.0)
        return self._point("Free", place, lump)


def _section_at(bounds: Sequence[float], s: float) -> int:
    """The section that begins at s or goes through it."""
    return max(i for i, x in enumerate(bounds[:-1]) if x <= s)


def _number(x: float) -> str:
    return f"{x:.12g}"
