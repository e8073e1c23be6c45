"""What people write for the words of a scene, and what to try instead."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_FLUID = "fluid: {density: ..., current: [x, y, z]}"
_SEA = "fluid: {density: ..., surface: 0, waves: {kind: regular, height: ..., period: ...}}"
_SEABED = "seabed: {z: ..., stiffness: ...}"
_MODULUS = ("axial_stiffness (E x area)", "bending_stiffness (E x second moment of area)")

# Other names for keys and kinds.  Of each, those count whose first word is known where the word stands,
# so one entry serves several tables: the wind is a current inside `fluid`, and a fluid inside `environment`.
ALIASES: dict[str, tuple[str, ...]] = {
    # sections
    "ei": ("bending_stiffness",),
    "flexural_rigidity": ("bending_stiffness",),
    "flexural_stiffness": ("bending_stiffness",),
    "gj": ("torsional_stiffness",),
    "gip": ("torsional_stiffness",),
    "torsion_stiffness": ("torsional_stiffness",),
    "ea": ("axial_stiffness",),
    "e": _MODULUS,
    "modulus": _MODULUS,
    "youngs_modulus": _MODULUS,
    "weight": ("mass (kg/m): the weight in air / gravity", "clump"),
    "w": ("mass (kg/m): the weight in air / gravity",),
    "m": ("mass (kg/m)",),
    "mass_per_length": ("mass (kg/m)",),
    "linear_density": ("mass (kg/m)",),
    "l": ("length",),
    "d": ("diameter",),
    "od": ("diameter",),
    "cd": ("drag: {normal: ...}", "normal", "drag_area: Cd x area"),
    "cdn": ("drag: {normal: ...}", "normal"),
    "cdt": ("drag: {tangential: ...}", "tangential"),
    "ca": ("added_mass: {normal: ...}", "normal"),
    "cda": ("drag_area (m^2)",),
    "cd_a": ("drag_area (m^2)",),
    "drag": ("drag_area (m^2)",),
    # attachments and bodies
    "s": ("at (m)",),
    "position": ("at (m)",),
    "displacement": ("volume (m^3)",),
    "lift": ("buoyancy (net)",),
    "net_buoyancy": ("buoyancy (net)",),
    "sinker": ("clump",),
    "ballast": ("clump",),
    "clump_weight": ("clump",),
    "buoy": ("body", "float"),
    "rov": ("body",),
    "vessel": ("body",),
    "floats": ("attachments: [{kind: float, ...}]",),
    "clumps": ("attachments: [{kind: clump, ...}]",),
    "modules": ("attachments: [{kind: modules, ...}]",),
    "cm": ("added_mass: {normal: Cm - 1}", "normal: Cm - 1"),
    # what surrounds the cable
    "rho": ("density", "fluid: {density: ...}", "mass (kg/m): density x area"),
    "density": ("fluid: {density: ...}", "mass (kg/m): density x area"),
    "wind": ("current", _FLUID),
    "velocity": ("current", _FLUID),
    "current": (_FLUID,),
    "profile": ("current: {kind: profile, table: ...}",),
    "table": ("profile",),
    "power": ("power_law",),
    "alpha": ("exponent",),
    "wave": ("waves", _SEA),
    "waves": (_SEA,),
    "surface": (_SEA,),
    "sea_level": ("surface", _SEA),
    "water_level": ("surface", _SEA),
    "msl": ("surface", _SEA),
    "mwl": ("surface", _SEA),
    "swl": ("surface", _SEA),
    "sea": (_SEA,),
    "airy": ("regular",),
    "linear": ("regular",),
    "stokes": ("regular (linear waves)",),
    "irregular": ("jonswap",),
    "spectrum": ("jonswap",),
    "pierson_moskowitz": ("jonswap (gamma: 1)",),
    "hs": ("significant_height",),
    "h": ("height", "significant_height"),
    "tp": ("peak_period",),
    "t": ("period", "peak_period"),
    "heading": ("direction",),
    "azimuth": ("direction",),
    # the seabed
    "bottom": (_SEABED,),
    "sea_bed": (_SEABED,),
    "sea_floor": (_SEABED,),
    "seafloor": (_SEABED,),
    "ground": (_SEABED,),
    "soil": (_SEABED,),
    "depth": ("seabed: {z: -depth, stiffness: ...}", "z: -depth"),
    "k": ("stiffness",),
    "kn": ("stiffness",),
    "mu": ("friction", "axial"),
    "coulomb": ("friction",),
    "transverse": ("lateral",),
    "normal": ("lateral",),
    "tangential": ("axial",),
    "water": (_FLUID,),
    "air": (_FLUID,),
    "g": ("gravity",),
    # ends, motion, time
    "frequency": ("period: 1 / frequency",),
    "freq": ("period: 1 / frequency",),
    "omega": ("period: 2 pi / omega",),
    "speed": ("velocity",),
    "tow": ("velocity",),
    "rao": ("heave",),
    "move": ("travel",),
    "to": ("by",),
    "dt": ("step",),
    "time_step": ("step",),
    "t_end": ("duration",),
    "elements": ("cells",),
    "segments": ("cells", "sections"),
    # kinds
    "fixed": ("clamped (position and direction held)", "pinned (position held)"),
    "built-in": ("clamped",),
    "encastre": ("clamped",),
    "cantilever": ("clamped",),
    "hinged": ("pinned",),
    "hinge": ("pinned",),
    "ball": ("pinned",),
    "anchor": ("pinned",),
    "anchored": ("pinned",),
    "slider": ("guided",),
    "static": ("equilibrium",),
    "statics": ("equilibrium",),
    "beam": ("rod",),
    "cable": ("catenary",),
    "string": ("catenary",),
    "hybrid": ("zones",),
}


def nearest(word: str, known: Iterable[str]) -> str:
    """What a word that is not known here may have meant, as a question; empty if nothing is near."""
    words = list(known)
    meant = [text for text in ALIASES.get(word.lower(), ()) if text.partition(":")[0].partition(" ")[0] in words]
    near = meant or difflib.get_close_matches(word.lower(), words, n=1, cutoff=0.6)
    return f"did you mean {' or '.join(near)}?" if near else ""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """The fix for a misspelt word: the nearest known one, or all of them."""
    words = list(known)
    return nearest(word, words) or f"known here: {', '.join(words)}"


def decimal_comma(text: str) -> str:
    """The fix for a number with a decimal comma."""
    return f"a decimal comma? write {text.replace(',', '.').strip()}"
