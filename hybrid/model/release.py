"""A line whose end is let go in mid-motion: what held the end is off, and everything else stays as it is."""

from __future__ import annotations

from dataclasses import replace

from hybrid.kernels.state.state import NO_TORSION, Line
from hybrid.model.build import Model
from hybrid.model.line import with_spin_inertia
from hybrid.model.line_on_base import LineOnBase


def without_hold(model: Model, k: int, t: float) -> Model:
    """The same model with end k (0 or 1) free from t (s) on; its motion is over.  The old one is as it was."""
    held = model.line if model.held is None else model.held
    return replace(unclamped(model, k), ends=model.ends.released_at(k, t), held=held)


def unclamped(model: Model, k: int) -> Model:
    """The same model without what holds the direction and the twist of end k (0 or 1)."""
    tangent, twist, hinged = model.cable.held_tangent, model.cable.held_twist, model.cable.hinged
    cable = replace(
        model.cable,
        held_tangent=(tangent[0] and k != 0, tangent[1] and k != 1),
        held_twist=(twist[0] and k != 0, twist[1] and k != 1),
        hinged=(hinged[0] or k == 0, hinged[1] or k == 1),
    )
    line, on_base = without_torque(without_clamp(model.line, -k)), None
    if model.layout is not None:
        line, on_base = with_spin_inertia(line, cable), LineOnBase(cable, model.layout.base)
    return replace(model, line=line, cable=cable, on_base=on_base)


def without_clamp(line: Line, node: int) -> Line:
    """The line without the element between an end and its clamp; without a clamp, the line itself."""
    if not line.element[node]:
        return line
    element, kb, k0, hn = line.element.copy(), line.kb.copy(), line.k0.copy(), line.hn.copy()
    element[node], kb[node], k0[node], hn[node] = 0, 0.0, 0.0, 0.5 * abs(line.s[node] - line.s[-2 if node else 1])
    return line._replace(element=element, kb=kb, k0=k0, hn=hn)


def without_torque(line: Line) -> Line:
    """The line without catenary zones that a torque passes through: it passes where both ends hold the twist."""
    return line._replace(torsion=NO_TORSION) if line.torsion.size else line
