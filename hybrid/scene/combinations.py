"""What does not combine, and why: the one table of it, read by the checks of a scene, the manual and the tests.

A feature is found in the tables of a scene by a function, which tells the keys that ask for it.  A refusal is a pair
of features with its reason; no other place refuses a combination of what can be computed each by itself.  Beside its
tables a scene may be looked at with the use that is to be made of it (`USE`): some pairs are of a scene and a use.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import Any, Literal

from hybrid.errors import Complaint, SceneError
from hybrid.scene.analysis import AdaptiveModel, RodModel, RodZone, ZonesModel
from hybrid.scene.attachments import BendRestrictor
from hybrid.scene.base import Finding, Place, Table, dotted
from hybrid.scene.cable import Cable, Section
from hybrid.scene.ends import Clamped, Ends, Payout, Pinned
from hybrid.scene.motion_tables import Load
from hybrid.scene.start_checks import SAME_LENGTH
from hybrid.scene.waves import StreamFunctionWaves

Tables = Mapping[str, Any]
# Why a pair is refused: it cannot be, or nobody has worked it out.  Several lines are refused what one cable is.
Kind = Literal["physics", "not worked out"]
# Beside the tables.
USE = "use"  # what is to be done with the scene
NETWORK = "network"  # of a line of several the scene of all of them
LINE = "line"  # and its name
Use = Literal["", "response", "derivatives"]
LEAVE_OUT = "leave it out"
IN_SPACE = "write `dimension: 3`, or leave dimension out"


@dataclass(frozen=True, eq=False)
class Feature:
    """Something that a scene may have, or that may be done with it."""

    name: str  # for people
    key: str  # where a scene asks for it, for people
    places: Callable[[Tables], Iterable[Place]]  # where these tables ask for it; none: they do not


@dataclass(frozen=True)
class Refusal:
    """A feature that is refused beside another one."""

    feature: Feature
    beside: Feature
    kind: Kind
    why: str  # after "because"; {key} is where the other one is asked for
    expected: str = "nothing"
    fix: str = LEAVE_OUT

    def finding(self, at: Place, beside: Place) -> Finding:
        expected = f"{self.expected}, because {self.why.format(key=dotted(beside))}"
        return Finding(at, expected, self.fix.format(key=dotted(beside)))

    def error(self, where: str, given: str) -> SceneError:
        """Where only the arrays of a line tell that a scene has both."""
        return SceneError([Complaint(where, given, f"{self.expected}, because {self.reason}", self.fix)])

    @property
    def reason(self) -> str:
        """Why, for people that have no scene before them."""
        return self.why.format(key=self.beside.key)


def refused(tables: Tables, beside: Feature | None = None) -> list[Finding]:
    """What is refused of what these tables have together; beside: in pairs with this feature alone."""
    found: list[Finding] = []
    for x in REFUSALS:
        if beside in (None, x.feature, x.beside) and (others := list(x.beside.places(tables))):
            other = _placed(tables, others[0])
            found += [x.finding(_placed(tables, at), other) for at in x.feature.places(tables)]
    return found


def refuse_use(scene: Table, use: Use, given: str = "") -> None:
    """SceneError where that cannot be done with a scene; given: what asks for it, if no key of the scene does."""
    found = dict.fromkeys(x for tables in tables_of(scene, use) for x in refused(tables))
    complaints = []
    for x in found:
        value = x.given or (given if x.at[0] not in type(scene).model_fields or x.at == ("lines",) else "")
        complaints.append(Complaint(dotted(x.at), value or value_at(scene, x.at), x.expected, x.fix))
    if complaints:
        raise SceneError(complaints)


def tables_of(scene: Table, use: Use = "") -> Iterator[dict[str, Any]]:
    """The tables of a cable, or of each line of several, with what is to be done with them."""
    tables = {name: getattr(scene, name) for name in type(scene).model_fields} | {USE: use}
    if "lines" not in tables:
        yield tables
        return
    for name, line in tables["lines"].items():
        own = {key: getattr(line, key) for key in ("connections", "mesh", "resolution", "contact", "initial")}
        yield tables | own | {"model": line.chosen_model, "cable": line.cable, NETWORK: scene, LINE: name}


# What the tables of a line have, whose keys are below the line in a scene of several.
_OF_LINE = ("connections", "mesh", "resolution", "contact", "initial", "model")


def _placed(tables: Tables, at: Place) -> Place:
    """Where a key of the tables of a line is in the scene of several."""
    name = tables.get(LINE)
    if at == ("contact",):  # of the network; of a line it has a key
        return at
    if name is not None and at[:1] == ("cable",):
        return "lines", name, *at[1:]
    return ("lines", name, *at) if name is not None and at[0] in _OF_LINE else at


def value_at(scene: Table, at: Place) -> str:
    """What a scene has there, for people."""
    value: Any = scene
    for part in at:
        value = getattr(value, part, None) if isinstance(value, Table) and isinstance(part, str) else value[part]
    if isinstance(value, Table):
        value = getattr(value, "kind", "a table")
    return "nothing" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


# --- where features are asked for ---------------------------------------------------------------


def _sections(tables: Tables) -> Iterator[tuple[Place, Section]]:
    """Sections of a cable, and those on a reel from which line is paid out, each with its place."""
    cable: Cable | None = tables.get("cable")
    for i, section in enumerate(cable.sections if cable is not None else ()):
        yield ("cable", "sections", i), section
    for at, payout in _winches(tables):
        for i, section in enumerate(payout.reel or ()):
            yield (*at, "reel", i), section


def _in_sections(*key: str, of: Callable[[Section], Any]) -> Callable[[Tables], Iterator[Place]]:
    """Keys of the sections of which `of` is true."""
    return lambda tables: ((*at, *key) for at, section in _sections(tables) if of(section))


def _winches(tables: Tables) -> Iterator[tuple[Place, Payout]]:
    """How line is paid out, at which end, of a cable or of a line of several."""
    ends: Ends | None = tables.get("ends")
    for name, end in ends.named().items() if ends is not None else ():
        if isinstance(end, Pinned | Clamped) and end.payout is not None:
            yield ("ends", name, "payout"), end.payout
    held = tables.get("connections")
    for name in ("start", "end") if held is not None else ():
        if (payout := getattr(held, name).payout) is not None:
            yield ("connections", name, "payout"), payout


def _paid_out(*ends: str) -> Callable[[Tables], Iterator[Place]]:
    return lambda tables: (at for at, _ in _winches(tables) if at[1] in ends)


def holds_rod(model: Any, end: str, length: float) -> bool:
    """Whether a line of this length (m) is a rod at an end, or may become one there."""
    if isinstance(model, AdaptiveModel):
        s, near = length * (end == "end"), SAME_LENGTH * length
        return not any(a - near <= s <= b + near for a, b in model.force_catenary or ())
    zone = model.zones[0 if end == "start" else -1] if isinstance(model, ZonesModel) else None
    return isinstance(model, RodModel) or isinstance(zone, RodZone)


def _damped_otherwise(tables: Tables) -> Iterator[Place]:
    """Sections with damping in proportion to stiffness where that is not implemented.

    The stiffness is not constant, tension makes a torque, or the line is clamped to what turns by the moments of its
    lines.
    """
    sections = [section for _, section in _sections(tables)]
    laws = any(x.curve or x.dynamic_stiffness or x.moment_curvature or x.tension_torque for x in sections)
    if laws or any(_restrictors(tables)) or (NETWORK in tables and any(_clamped_to_free(tables))):
        yield from _in_sections("damping", "stiffness", of=lambda x: x.damped.stiffness)(tables)


def _turns(tables: Tables) -> Iterator[Place]:
    ends: Ends | None = tables.get("ends")
    for name, end in ends.named().items() if ends else ():
        if end.held_turns:
            yield "ends", name, "turns"
    for at in _clamped(tables):
        if getattr(tables["connections"], str(at[1])).turns:
            yield (*at, "turns")


def _restrictors(tables: Tables) -> Iterator[tuple[Place, BendRestrictor]]:
    """Bend restrictors, each with its place."""
    cable: Cable | None = tables.get("cable")
    for i, x in enumerate(cable.attachments if cable is not None else ()):
        if isinstance(x, BendRestrictor):
            yield ("cable", "attachments", i, "kind"), x


def _tables_beside_two_stiffnesses(tables: Tables) -> Iterator[Place]:
    cable: Cable | None = tables.get("cable")
    sections = cable.sections if cable is not None else ()
    for i, section in enumerate(sections):
        beside = (*sections[max(i - 1, 0) : i], *sections[i + 1 : i + 2])
        if section.elastic_table and any(x.anisotropic for x in beside):
            yield "cable", "sections", i, "moment_curvature"


def _locks(tables: Tables) -> Iterator[tuple[Place, float, float]]:
    """Bend restrictors on sections of two bending stiffnesses, or beside these, and stretches (m) that both have."""
    for at, item in _restrictors(tables):
        sections = tables["cable"].sections
        for end, x in zip(accumulate(x.length for x in sections), sections, strict=True):
            low, high = max(item.range[0], end - x.length), min(item.range[1], end)
            if x.anisotropic and low <= high:
                yield at, low, high


def _slips(tables: Tables) -> Iterator[Place]:
    for at, x in _sections(tables):
        if x.slip_layers:
            given = (key for key in ("bending_slip", "first_loading", "stiffness_per_tension") if getattr(x, key))
            yield *at, next(given)
    yield from dict.fromkeys(at for at, _, _ in _locks(tables))
    yield from _tables_beside_two_stiffnesses(tables)


def _asks(*at: str, when: Callable[[Any], Any]) -> Callable[[Tables], Iterator[Place]]:
    """A table that is there, or a key of it, when `when` is true of the table."""
    table = at[0]
    return lambda tables: iter([at] if tables.get(table) is not None and when(tables[table]) else [])


def _clamped(tables: Tables) -> Iterator[Place]:
    held = tables.get("connections")
    for end in ("start", "end"):
        if held is not None and getattr(held, end).kind == "clamped":
            yield "connections", end


def _clamped_to_free(tables: Tables) -> Iterator[Place]:
    """Clamps to free points and free bodies, which turn by the moments of their lines."""
    for at in _clamped(tables):
        if tables[NETWORK].is_joined(getattr(tables["lines"][tables[LINE]], str(at[1]))):
            yield at


def _shapes(tables: Tables) -> Iterator[Place]:
    """Shapes of bodies that lines touch."""
    return (("bodies", name, "shape") for name in (tables[NETWORK].shaped if NETWORK in tables else ()))


def _moving_obstacles(tables: Tables) -> Iterator[Place]:
    """Obstacles that move, turn or are set from outside."""
    return (("obstacles", name) for name, x in (tables.get("obstacles") or {}).items() if getattr(x, "moves", False))


def _prescribed_obstacles(tables: Tables) -> Iterator[Place]:
    """Obstacles whose motion is given."""
    obstacles = tables.get("obstacles") or {}
    return (("obstacles", name, "motion") for name, x in obstacles.items() if getattr(x, "motion", None))


def _lines_touch(tables: Tables) -> Iterator[Place]:
    """A line of several that touches another one."""
    if NETWORK in tables and any(tables[LINE] in pair for pair in tables[NETWORK].touching_pairs):
        yield ("contact",)


def _changing_loads(tables: Tables) -> Iterator[Place]:
    """Forces and moments on ends, points and bodies that follow a history or end at a time."""
    ends: Ends | None = tables.get("ends")
    holders: list[tuple[Place, Any]] = [(("ends", x), end) for x, end in ends.named().items()] if ends else []
    if NETWORK in tables:
        holders = [((key, x), one) for key in ("points", "bodies") for x, one in getattr(tables[NETWORK], key).items()]
    for at, holder in holders:
        for name in ("force", "moment", "thrust"):
            load = getattr(holder, name, None)
            if isinstance(load, Load) and (load.value is None or load.until is not None):
                yield (*at, name)


def _either(*features: Feature) -> Callable[[Tables], Iterator[Place]]:
    """Where one of several features is asked for, which are refused for one reason."""
    return lambda tables: (at for x in features for at in x.places(tables))


def _used(*uses: Use) -> Callable[[Tables], Iterator[Place]]:
    return lambda tables: iter([(tables[USE],)] if tables.get(USE) in uses else [])


# --- features -----------------------------------------------------------------------------------

MOVING_ZONES = Feature(
    "zones that move", "model: adaptive", _asks("model", when=lambda x: isinstance(x, AdaptiveModel))
)
TWO_STIFFNESSES = Feature(
    "two bending stiffnesses",
    "bending_stiffness: [EI_1, EI_2]",
    _in_sections("bending_stiffness", of=lambda x: x.anisotropic),
)
TORQUE_OF_TENSION = Feature(
    "torque of tension", "tension_torque", _in_sections("tension_torque", of=lambda x: x.tension_torque)
)
VORTICES = Feature("vortex-induced vibration", "vortices", _in_sections("vortices", of=lambda x: x.vortices))
SLIP = Feature(
    "layers that slip as a line bends, a bending stiffness that grows with tension, a bend restrictor on two bending "
    "stiffnesses, a table of moment beside them",
    "bending_slip, first_loading, stiffness_per_tension, attachments: kind: bend_restrictor, moment_curvature",
    _slips,
)
DAMPED_OTHERWISE = Feature(
    "damping proportional to stiffness of laws and tables, with torque of tension, of a line clamped to what turns",
    "damping.stiffness",
    _damped_otherwise,
)
TURNS = Feature("turns at an end", "ends.end.turns", _turns)
TORSION = Feature(
    "turns at an end, torque of tension", "ends.end.turns, tension_torque", _either(TURNS, TORQUE_OF_TENSION)
)
PLANE = Feature("a plane", "dimension: 2", _asks("dimension", when=lambda x: x == 2))
PAYOUT = Feature("line that is paid out", "ends.end.payout", _paid_out("start", "end"))
PAYOUT_AT_START = Feature("line that is paid out at one end", "ends.start.payout", _paid_out("start"))
PAYOUT_AT_END = Feature("line that is paid out at the other end", "ends.end.payout", _paid_out("end"))
SHAPES = Feature("bodies that lines touch", "bodies.NAME.shape", _shapes)
LINES_TOUCH = Feature("contact of lines with each other", "contact", _lines_touch)
PRESCRIBED_OBSTACLES = Feature("obstacles whose motion is given", "obstacles.NAME.motion", _prescribed_obstacles)
GOES_ITS_WAY = Feature(
    "contact of lines with each other, with bodies, with obstacles that move",
    "contact, bodies.NAME.shape, obstacles.NAME.motion",
    _either(LINES_TOUCH, SHAPES, Feature("obstacles that move", "motion", _moving_obstacles)),
)
ACCURACY = Feature("accuracy", "accuracy", _asks("accuracy", when=bool))
ERRORS = Feature(
    "estimated errors", "output.errors", _asks("output", "errors", when=lambda x: getattr(x, "errors", None))
)
_chosen_steps = _asks("time", "step", when=lambda x: x.step is None and x.tolerance is None)
CHOSEN_STEPS = Feature("steps that an accuracy chooses", "no time.step", _chosen_steps)
_ESTIMATED = "estimated errors, accuracy, steps that it chooses"
ESTIMATED = Feature(_ESTIMATED, "accuracy, output.errors, no time.step", _either(CHOSEN_STEPS, ACCURACY, ERRORS))
SETTLED_FRICTION = Feature(
    "friction that has settled in the equilibrium",
    "initial.friction",
    _asks("initial", "friction", when=lambda x: getattr(x, "friction", None) == "settled"),
)

RESPONSE = Feature("response to a sea", "hybrid response", _used("response"))
DERIVATIVES = Feature("derivatives at rest", "hybrid sensitivity", _used("derivatives"))
_OTHER_MOTIONS = "motions that are no sum of harmonics, loads that change in time"
OTHER_MOTIONS = Feature(_OTHER_MOTIONS, "motion.file, motion.travel, force.history", _changing_loads)
FINITE_WAVES = Feature(
    "waves of finite height",
    "waves.kind: stream_function",
    _asks("environment", "fluid", "waves", "kind", when=lambda x: isinstance(x.waves, StreamFunctionWaves)),
)

RESPONSE_TO_MOTION = Refusal(
    OTHER_MOTIONS,
    RESPONSE,
    "physics",
    "a response by frequency is of what is constant or a sum of harmonics",
    "harmonics, and loads that stay",
    "hybrid run computes it in time",
)
REFUSALS: tuple[Refusal, ...] = (
    Refusal(
        TWO_STIFFNESSES, MOVING_ZONES, "physics",
        "zones move (model), and a catenary does not know which way its sections lie",
        "one number", "give one number, or write `model: rod`",
    ),
    Refusal(
        SLIP, MOVING_ZONES, "not worked out",
        "zones move (model), and a catenary forgets how far layers have slipped, and what tension adds to stiffness",
        fix="leave it out, or write `model: rod`",
    ),
    Refusal(
        TORSION, PLANE, "physics", "dimension is 2 and there is no torsion", "nothing or 0",
        f"leave it out, or {IN_SPACE}",
    ),
    # --- obstacles, and other lines ---
    Refusal(
        ESTIMATED, LINES_TOUCH, "not worked out",
        "lines that meet ({key}) do so at other instants with other steps, and figures go down to a fifth of the truth",
        "a step, in s, and no accuracy or errors",
        "give `step: ...` (s) in time, leave accuracy and output.errors out; halve step and cells to see their error",
    ),
    Refusal(
        SETTLED_FRICTION, GOES_ITS_WAY, "not worked out",
        "what touches ({key}) is a line, a body or an obstacle that moves, whose friction is neglected in equilibria",
        "neglected",
    ),
    # --- response and derivatives ---
    RESPONSE_TO_MOTION,
    Refusal(
        FINITE_WAVES, RESPONSE, "physics", "a response by frequency is linear in the waves, and these are not",
        "waves of another kind", "kind: regular has the same height and period; hybrid run computes these in time",
    ),
    Refusal(
        PRESCRIBED_OBSTACLES, RESPONSE, "not worked out",
        "in a response by frequency obstacles rest, or move with what carries them",
        fix="leave it out; hybrid run computes it in time",
    ),
    Refusal(
        DERIVATIVES, SETTLED_FRICTION, "physics", "friction has settled ({key}), and how depends on the way there",
        "a rest without friction", "leave initial.friction out, or write neglected",
    ),
    # --- line that is paid out ---
    Refusal(
        PAYOUT_AT_START, PAYOUT_AT_END, "not worked out", "line is paid out at ends.end", fix="leave one out"
    ),
    Refusal(
        DAMPED_OTHERWISE, PAYOUT, "not worked out",
        "how the material flows through it as line is paid out ({key}) is known of damping in proportion to constant "
        "stiffnesses, without torque of tension, between ends that do not turn by what pulls there",
        fix="leave it out; damping.mass can stay",
    ),
    Refusal(
        VORTICES, PLANE, "physics", "vortices shake a line across its plane ({key})", "nothing", IN_SPACE,
    ),
    Refusal(
        VORTICES, RESPONSE, "physics",
        "a response by frequency is linear about rest, and wakes oscillate by themselves, with a size and a frequency "
        "that their locking in to the motion decides",
        fix="leave it out; hybrid run computes it in time",
    ),
)  # fmt: skip
