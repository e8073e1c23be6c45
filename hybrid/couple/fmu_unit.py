"""A scene as a co-simulation unit of FMI 3.0: what runs inside an FMU that `hybrid.couple.fmu_export` has written.

Inputs are what the ends reach at the end of a communication step: place (m), velocity (m/s) and rotation vector (rad,
from the start's frame) of held ends, force (N) and moment (N m) of free ones; all inertial.  Outputs are forces and
moments of the cable on what holds its ends, places and velocities of the ends, the largest and the lowest tension.
Of lines that have names points stand in place of ends, and what is of a line begins with its name.
"""

from __future__ import annotations

import json
from collections.abc import Callable
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
from hybrid.model.ends import rotation
from hybrid.simulation.stepping import Simulation

OF_MOTION = Unit("m", m=1), Unit("s", s=1), Unit("m/s", m=1, s=-1), Unit("rad", rad=1)
UNITS = (*OF_MOTION, Unit("N", kg=1, m=1, s=-2), Unit("N.m", kg=1, m=2, s=-2))
# Of a communication step: how far the master's clock may be from that of the cable.
CLOCK = 1e-6
INPUTS = {
    "position": ("m", "place of the {} at the end of a step"),
    "velocity": ("m/s", "velocity of the {} there"),
    "rotation": ("rad", "rotation vector from its frame at the start, at the end of a step"),
    "applied_force": ("N", "force on the free {} from the next step on"),
    "applied_moment": ("N.m", "moment on the free {} from the next step on"),
}
# What `Simulation.settable` says where these may be set.
SET_BY = {"position": "position", "velocity": "position", "rotation": "frame"}
SET_BY |= {"applied_force": "force", "applied_moment": "moment"}
# With the numbers of a `PointState` that they are.
OUTPUTS = {
    "force": ("N", "force of its lines on the {}", 2),
    "moment": ("N.m", "moment of its lines on the {}", 3),
    "node_position": ("m", "where the {} is", 0),
    "node_velocity": ("m/s", "velocity of the {}", 1),
}


class SceneUnit:
    """The variables and steps of an FMU of a scene; a subclass names the model and inherits Fmi3Slave as well."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._folder = Path(self.resources)  # type: ignore[attr-defined]
        known = json.loads((self._folder / INTERFACE).read_text(encoding="utf-8"))
        self._simulation: Simulation | None = None
        self._values: dict[str, Floats] = {}
        self._recovered: dict[str, Floats] = {}  # tension along each line now
        self._refused = ""  # why a state could not be set
        self.output_file, self.inputs_at_begin = "", False
        self.author, self.description = "hybrid", f"{known['name']}: hybrid, Kirchhoff rods and catenaries"
        self.default_experiment = DefaultExperiment(0.0, known["duration"], known["step"])
        self.register_units(UNITS)  # type: ignore[attr-defined]
        self._register_common()
        self._register_parts(known)

    def _register_parts(self, known: dict[str, Any]) -> None:
        """Of every end or point what may be set and read; of every line the length that is out, and its tension."""
        if isinstance(known.get("lines"), list):  # as 1.0.0 has exported several lines, of which nothing was paid out,
            known["lines"] = {name: {} for name in known["lines"]}
        of_lines = known.get("lines", {"": known})  # and one
        self._called = "end" if "" in of_lines else "point"
        self._points: dict[str, dict[str, Any]] = known.get("points") or known["ends"]
        for name, of in self._points.items():
            self._register_point(name, of["settable"], np.array(of["position"]))
        self._winches = dict[str, str]()
        for name, of in of_lines.items():
            self._register_line(name, bool(of.get("payout")), bool(of.get("winch")))

    def _register_line(self, line: str, payout: bool, winch: bool) -> None:
        """The variables of a line, which begin with its name."""
        before, along = (f"{line}.", f"along line {line}") if line else ("", "along the cable")
        if winch:
            self._winches[line] = f"{before}payout_rate"
            text = "rate at which line is paid out at the end of a step; negative: taken in"
            self.vector(f"{before}payout_rate", "m/s", text, np.zeros(1))
        if payout:
            text = "unstretched length that is out"
            self.output(f"{before}length", "m", text, lambda: self._length(line))
        self.tensions(line, before, along)

    def _register_point(self, point: str, settable: Any, position: Floats) -> None:
        """The variables of an end or a point.  settable: of several lines exported by 1.0.0 whether it is."""
        names = {True: ("position",), False: ()}[settable] if isinstance(settable, bool) else settable
        for name, (unit, text) in INPUTS.items():
            if SET_BY[name] in names:
                begin = position if name == "position" else np.zeros(3)
                self.vector(f"{point}.{name}", unit, text.format(self._called), begin)
                if name == "velocity":  # whether the master has ever given another one than zero
                    self._values[f"{point}.moves"] = np.zeros(1)
        for name, (unit, text, _) in OUTPUTS.items():
            self.vector(f"{point}.{name}", unit, text.format(self._called), None)

    @property
    def simulation(self) -> Simulation:
        """The simulation, begun when it is first needed: parameters are set before."""
        if self._simulation is None:
            self._simulation = made = Simulation(self._folder / SCENE, self.output_file or None)
            self._frames = {name: made.point(name).frame for name in self._points}
        return self._simulation

    def _value_of(self, part: str, name: str) -> Floats:
        """An output (3,) of an end or a point; NaN: of a step that has failed."""
        try:
            return np.asarray(self.simulation.point(part)[OUTPUTS[name][2]])
        except ValueError as error:  # an exception here would end the master
            self.log(str(error), Fmi3Status.warning)  # type: ignore[attr-defined]
            return np.full(3, np.nan)

    def _apply(self, step: float) -> None:
        """Hand the inputs of a step (s) to the simulation."""
        values = self._values
        for line, name in self._winches.items():
            self.simulation.set_payout(*filter(None, [line]), float(values[name][0]))
        for name in self._points:
            placed, turn = self.placed(name, step), values.get(f"{name}.rotation")
            frame = None if turn is None else rotation(turn) @ self._frames[name]
            if placed is not None or frame is not None:
                place, speed = placed or (None, None)
                self.simulation.set_point(name, place, speed, frame)
            force, moment = values.get(f"{name}.applied_force"), values.get(f"{name}.applied_moment")
            if force is not None:
                self.simulation.set_force(name, force, moment)

    def _register_common(self) -> None:
        fixed = {"causality": Fmi3Causality.parameter, "variability": Fmi3Variability.fixed}
        add = self.register_variable  # type: ignore[attr-defined]
        clock = {"causality": Fmi3Causality.independent, "variability": Fmi3Variability.continuous, "unit": "s"}
        add(Float64("time", getter=lambda: self.simulation.t, **clock))
        text = "HDF5 file to write the result to; empty: none is written"
        add(String("output_file", description=text, **fixed))
        text = "inputs are of the begin of a step: places go on with their velocity for one step"
        add(Boolean("inputs_at_begin", description=text, **fixed))

    def output(self, name: str, unit: str, text: str, get: Callable[[], float]) -> None:
        """Register a number that is read."""
        what = {"causality": Fmi3Causality.output, "variability": Fmi3Variability.continuous, "unit": unit}
        variable = Float64(name, description=text, getter=get, **what)
        self.register_variable(variable, nested=False)  # type: ignore[attr-defined]

    def tensions(self, line: str, prefix: str, of: str) -> None:
        """Register the extremes of the tension along a line."""
        self.output(f"{prefix}tension_max", "N", f"largest tension {of}", lambda: float(self._tension(line).max()))
        self.output(f"{prefix}tension_min", "N", f"lowest tension {of}", lambda: float(self._tension(line).min()))

    def vector(self, name: str, unit: str, text: str, begin: Floats | None) -> None:
        """Scalars, which all masters can connect: three of a vector, or one number.

        begin: of an input; None: it is an output of an end or a point.
        """
        if begin is not None:
            self._values[name] = begin
        causality = Fmi3Causality.output if begin is None else Fmi3Causality.input
        for axis, letter in enumerate("xyz" if begin is None or begin.size == 3 else [""]):

            def get(axis: int = axis) -> float:
                return float((self._values[name] if begin is not None else self._value_of(*name.rsplit(".", 1)))[axis])

            def put(value: float, axis: int = axis) -> None:
                self._values[name][axis] = value

            variable = Float64(
                f"{name}.{letter}".rstrip("."),
                causality=causality,
                variability=Fmi3Variability.continuous,
                unit=unit,
                description=f"{text}, {letter}".rstrip(", "),
                getter=get,
                setter=put if begin is not None else None,
            )
            self.register_variable(variable, nested=False)  # type: ignore[attr-defined]

    def placed(self, part: str, step: float) -> tuple[Floats, Floats | None] | None:
        """Place and velocity that are set of an end or a point, at the end of a step (s); None: none are."""
        place, speed = (self._values.get(f"{part}.{name}") for name in ("position", "velocity"))
        if place is None or speed is None:
            return None
        given = self._values[f"{part}.moves"]
        given[0] = max(given[0], speed.any())
        return (place + step * speed if self.inputs_at_begin else place), speed if given[0] else None

    def _tension(self, line: str) -> Floats:
        """Tension along a line, as recovered once for a state."""
        if line not in self._recovered:
            try:
                simulation = self.simulation
                self._recovered[line] = simulation.tension(line) if line else simulation.tension()
            except ValueError as error:  # an exception here would end the master
                self.log(str(error), Fmi3Status.warning)  # type: ignore[attr-defined]
                return np.full(1, np.nan)
        return self._recovered[line]

    def _length(self, line: str) -> float:
        simulation = self.simulation
        return float(np.ptp(simulation.line(line).s)) if line else simulation.length

    # --- what a master calls ------------------------------------------------------------------------

    def exit_initialization_mode(self) -> None:
        self.simulation  # noqa: B018  # begun now at the latest

    def do_step(self, current_time: float, step_size: float) -> Fmi3StepResult:
        """One communication step; `discard` where a shorter one may do (after a return to a saved state)."""
        self._recovered.clear()
        try:
            if self._refused:
                raise ValueError(self._refused)
            now = self.simulation.t
            if abs(current_time - now) > CLOCK * max(step_size, 0.0):
                raise ValueError(f"a step from {current_time:.9g} s, but the cable is at {now:.9g} s")
            self._apply(step_size)
            self.simulation.advance(current_time + step_size)
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

    def terminate(self) -> None:
        try:
            if self._simulation is not None:
                self._simulation.close()
        except HybridError as error:  # an exception here would end the master
            self.log(str(error), Fmi3Status.error)  # type: ignore[attr-defined]

    def _get_fmu_state(self) -> dict[str, Any]:
        values = {name: value.copy() for name, value in self._values.items()}
        try:
            return {"cable": self.simulation.save(), "values": values}
        except ValueError as error:  # a step has failed: this is no state to come back to, which the return to it says
            self.log(str(error), Fmi3Status.error)  # type: ignore[attr-defined]
            return {"cable": None, "values": values}

    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self._recovered.clear()
        try:
            self.simulation.restore(state["cable"])
        except ValueError as error:  # an exception here would end the master: the next step says it
            self._refused = str(error)
            return
        self._refused = ""
        for name, value in state["values"].items():
            self._values[name][:] = value


# Of units that were exported by 1.0.0.
CableUnit = LinesUnit = SceneUnit
