"""A cable as a co-simulation unit of FMI 3.0: what runs inside an FMU that `hybrid.couple.fmu_export` has written.

Inputs are what the ends reach at the end of a communication step: place (m), velocity (m/s) and rotation vector (rad,
from the start's frame) of held ends, force (N) and moment (N m) of free ones; all inertial.  Outputs are forces and
moments of the cable on what holds its ends, places and velocities of the ends, the largest and the lowest tension.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from pythonfmu3 import (
    Boolean,
    DefaultExperiment,
    Float64,
    Fmi3Causality,
    Fmi3Status,
    Fmi3StepResult,
    Fmi3Variability,
    String,
    Unit,
)

from hybrid.couple.fmu_export import INTERFACE, SCENE
from hybrid.errors import ComputationError, HybridError
from hybrid.kernels.state.state import Floats
from hybrid.model.driven_end import rotation
from hybrid.scene.read import load_scene
from hybrid.simulation.stepped_ends import ENDS
from hybrid.simulation.stepping import Simulation

UNITS = (
    Unit("m", m=1), Unit("s", s=1), Unit("m/s", m=1, s=-1), Unit("rad", rad=1), Unit("N", kg=1, m=1, s=-2),
    Unit("N.m", kg=1, m=2, s=-2),
)  # fmt: skip
# Of a communication step: how far the master's clock may be from that of the cable.
CLOCK = 1e-6
INPUTS = {
    "position": ("m", "place of the end at the end of a step"),
    "velocity": ("m/s", "velocity of the end there"),
    "rotation": ("rad", "rotation vector from its frame at the start, at the end of a step"),
    "applied_force": ("N", "force on the free end from the next step on"),
    "applied_moment": ("N.m", "moment on the free end from the next step on"),
}
OUTPUTS = {
    "force": ("N", "force of the cable on what holds the end"),
    "moment": ("N.m", "moment of the cable on what holds the end"),
    "node_position": ("m", "where the end is"),
    "node_velocity": ("m/s", "velocity of the end"),
}


class CableUnit:
    """The variables and steps of an FMU; a subclass names the model and inherits pythonfmu3's Fmi3Slave as well."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._folder = Path(self.resources)  # type: ignore[attr-defined]
        known = json.loads((self._folder / INTERFACE).read_text(encoding="utf-8"))
        self._cable: Simulation | None = None
        self._values: dict[str, Floats] = {}
        self._recovered: Floats | None = None  # tension along the cable now
        self._refused = ""  # why a state could not be set
        self.output_file, self.inputs_at_begin = "", False
        self.author, self.description = "hybrid", f"cable {known['name']}: hybrid, Kirchhoff rods and catenaries"
        self.default_experiment = DefaultExperiment(0.0, known["duration"], known["step"])
        self.register_units(UNITS)  # type: ignore[attr-defined]
        self.payout_rate, self._winch = 0.0, bool(known["winch"])
        self._register(known["ends"], bool(known["payout"]))

    def _register(self, ends: dict[str, Any], pays_out: bool) -> None:
        fixed = {"causality": Fmi3Causality.parameter, "variability": Fmi3Variability.fixed}
        add = self.register_variable  # type: ignore[attr-defined]
        clock = {"causality": Fmi3Causality.independent, "variability": Fmi3Variability.continuous, "unit": "s"}
        add(Float64("time", getter=lambda: self.cable.t, **clock))
        text = "HDF5 file to write the result to; empty: none is written"
        add(String("output_file", description=text, **fixed))
        text = "inputs are of the begin of a step: places go on with their velocity for one step"
        add(Boolean("inputs_at_begin", description=text, **fixed))
        for end in ENDS:
            settable = ends[end]["settable"]
            wanted = {"position": settable.count("position"), "velocity": settable.count("position")}
            wanted |= {"rotation": settable.count("frame"), "applied_force": settable.count("force")}
            wanted["applied_moment"] = settable.count("moment")
            for name, (unit, text) in INPUTS.items():
                if wanted[name]:
                    begin = ends[end]["position"] if name == "position" else np.zeros(3)
                    self._vector(end, name, unit, text, np.array(begin))
            for name, (unit, text) in OUTPUTS.items():
                self._vector(end, name, unit, text, None)
        if self._winch:
            text = "rate at which line is paid out at the end of a step; negative: taken in"
            what = {"causality": Fmi3Causality.input, "variability": Fmi3Variability.continuous, "unit": "m/s"}
            add(Float64("payout_rate", description=text, **what))
        if pays_out:
            text = "unstretched length that is out"
            what = {"causality": Fmi3Causality.output, "variability": Fmi3Variability.continuous, "unit": "m"}
            add(Float64("length", description=text, getter=lambda: self.cable.length, **what))
        for name, text in (("tension_max", "largest"), ("tension_min", "lowest")):
            what = {"causality": Fmi3Causality.output, "variability": Fmi3Variability.continuous, "unit": "N"}
            add(Float64(name, description=f"{text} tension along the cable", getter=getattr(self, f"_{name}"), **what))

    def _vector(self, end: str, name: str, unit: str, text: str, begin: Floats | None) -> None:
        """Three scalars, which all masters can connect."""
        if begin is not None:
            self._values[f"{end}.{name}"] = begin
        causality = Fmi3Causality.output if begin is None else Fmi3Causality.input
        for axis, letter in enumerate("xyz"):

            def get(axis: int = axis) -> float:
                return float((self._values[f"{end}.{name}"] if begin is not None else self._of(end, name))[axis])

            def put(value: float, axis: int = axis) -> None:
                self._values[f"{end}.{name}"][axis] = value

            variable = Float64(
                f"{end}.{name}.{letter}", causality=causality, variability=Fmi3Variability.continuous, unit=unit,
                description=f"{text}, {letter}", getter=get, setter=put if begin is not None else None,
            )  # fmt: skip
            self.register_variable(variable, nested=False)  # type: ignore[attr-defined]

    # --- the cable ----------------------------------------------------------------------------------

    @property
    def cable(self) -> Simulation:
        """The simulation, begun when it is first needed: parameters are set before."""
        if self._cable is None:
            self._cable = Simulation(load_scene(self._folder / SCENE), self.output_file or None)
            self._frames = self._cable.frames()
        return self._cable

    def _of(self, end: str, name: str) -> Floats:
        k, cable = ENDS.index(end), self.cable
        if name == "node_position":
            return cable.state.position[-k]
        if name == "node_velocity":
            return cable.state.velocity[-k]
        try:
            forces = cable.forces()
        except ValueError as error:  # an exception here would end the master
            self.log(str(error), Fmi3Status.warning)  # type: ignore[attr-defined]
            return np.full(3, np.nan)
        return forces[k] if name == "force" else forces[2 + k]

    def _tension(self) -> Floats:
        """Tension along the cable, at the points of the result, as recovered once for a state."""
        if self._recovered is None:
            try:
                self._recovered = self.cable.tension()
            except ValueError as error:
                self.log(str(error), Fmi3Status.warning)  # type: ignore[attr-defined]
                return np.full(1, np.nan)
        return self._recovered

    def _tension_max(self) -> float:
        return float(self._tension().max())

    def _tension_min(self) -> float:
        return float(self._tension().min())

    # --- what a master calls ------------------------------------------------------------------------

    def exit_initialization_mode(self) -> None:
        self.cable  # noqa: B018  # begun now at the latest

    def do_step(self, current_time: float, step_size: float) -> Fmi3StepResult:
        """One communication step; `discard` where a shorter one may do (after a return to a saved state)."""
        self._recovered = None
        try:
            if self._refused:
                raise ValueError(self._refused)
            if abs(current_time - self.cable.t) > CLOCK * max(step_size, 0.0):
                raise ValueError(f"a step from {current_time:.9g} s, but the cable is at {self.cable.t:.9g} s")
            self._apply(step_size)
            self.cable.advance(current_time + step_size)
        except ComputationError as error:
            return self._failed(error, Fmi3Status.discard)
        except (ValueError, HybridError) as error:
            return self._failed(error, Fmi3Status.error)
        except Exception as error:  # a defect: an exception that leaves this function ends the master's process
            return self._failed(RuntimeError(f"{type(error).__name__}: {error}"), Fmi3Status.error)
        return Fmi3StepResult(status=Fmi3Status.ok)

    def _failed(self, error: Exception, status: Fmi3Status) -> Fmi3StepResult:
        self.log(str(error), status)  # type: ignore[attr-defined]
        return Fmi3StepResult(status=status)

    def _apply(self, step: float) -> None:
        """Hand the inputs to the simulation."""
        values = self._values
        if self._winch:
            self.cable.set_payout(self.payout_rate)
        for k, end in enumerate(ENDS):
            place, speed, turn = (values.get(f"{end}.{name}") for name in ("position", "velocity", "rotation"))
            if place is not None and speed is not None:
                place = place + step * speed if self.inputs_at_begin else place
            frame = None if turn is None else rotation(turn) @ self._frames[k]
            if place is not None or frame is not None:
                self.cable.set_end(end, place, speed, frame)
            force, moment = values.get(f"{end}.applied_force"), values.get(f"{end}.applied_moment")
            if force is not None:
                self.cable.set_force(end, force, moment)

    def terminate(self) -> None:
        try:
            if self._cable is not None:
                self._cable.close()
        except HybridError as error:  # an exception here would end the master
            self.log(str(error), Fmi3Status.error)  # type: ignore[attr-defined]

    def _get_fmu_state(self) -> dict[str, Any]:
        values = {name: value.copy() for name, value in self._values.items()}
        try:
            return {"cable": self.cable.save(), "values": values}
        except ValueError as error:  # a step has failed: this is no state to come back to, which the return to it says
            self.log(str(error), Fmi3Status.error)  # type: ignore[attr-defined]
            return {"cable": None, "values": values}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self._recovered = None
        try:
            self.cable.restore(state["cable"])
        except ValueError as error:  # an exception here would end the master: the next step says it
            self._refused = str(error)
            return
        self._refused = ""
        for name, value in state["values"].items():
            self._values[name][:] = value
