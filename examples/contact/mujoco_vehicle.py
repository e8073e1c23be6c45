"""A vehicle in MuJoCo on a tether that winds around a pile: two programs, one loop, in real time.

Shows:    `hybrid.Simulation` in the loop of another simulator: the end of the tether and the pile are where MuJoCo has
          them (`set_end`, `set_obstacle`), and what the tether does to both acts in MuJoCo's next step; Newton's
          iterations are bounded (`most_iterations`), so that no step takes long.
Physics:  a vehicle of 40 kg, with drag and thrusters, is led around a pile that stands on springs of 2 kN/m and gives
          way; its tether of 60 rods leads from a fixed point to it, lies against the pile with friction, and comes off.
Look at:  the tether pulls the pile towards the vehicle, and its pull at the fixed point falls below that at the vehicle
          by the friction on the pile.  Forces act a step late (docs/coupling.md, explicit): with 5 ms and 40 kg that
          holds up to K = 4 m/dt^2 = 6 MN/m.
Run time: 6 s for 40 s of motion.
Source:   MuJoCo 3 (Google DeepMind); `pip install "hybrid-cable[mujoco]"`.

    python examples/contact/mujoco_vehicle.py
"""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np

import hybrid

STEP, DURATION = 0.005, 40.0  # s
RADIUS, FRICTION = 0.45, 0.3  # m, -, of the pile
PILE, START = np.array([3.0, 0.0, 0.0]), np.array([5.0, -1.5, 0.0])  # m
DRAG, STIFF, DAMPED, STRONGEST = 60.0, 150.0, 120.0, 250.0  # N s2/m2; N/m, N s/m, N of the thrusters

WORLD = f"""
<mujoco>
  <option timestep="{STEP}" gravity="0 0 0" integrator="implicitfast"/>
  <worldbody>
    <body name="pile" pos="{PILE[0]} {PILE[1]} {PILE[2]}">
      <joint type="slide" axis="1 0 0" stiffness="2000" damping="400"/>
      <joint type="slide" axis="0 1 0" stiffness="2000" damping="400"/>
      <geom type="cylinder" size="{RADIUS} 2" mass="300"/>
    </body>
    <body name="vehicle" pos="{START[0]} {START[1]} {START[2]}">
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
      <geom type="box" size="0.3 0.2 0.15" mass="40"/>
    </body>
  </worldbody>
</mujoco>
"""

TETHER: dict[str, Any] = {
    "environment": {"fluid": {"density": 1025}},
    "cable": {"sections": [{
        "length": 6.45, "mass": 0.4, "diameter": 0.02, "axial_stiffness": 2e4, "bending_stiffness": 0.5,
        "drag": {"normal": 1.2, "tangential": 0.02}, "added_mass": {"normal": 1.0}, "damping": {"stiffness": 0.01},
    }]},
    "obstacles": {"pile": {
        "kind": "cylinder", "at": PILE.tolist(), "axis": [0, 0, 1], "radius": RADIUS, "friction": FRICTION,
        "from_outside": True,
    }},
    "ends": {
        "start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": START.tolist()},
    },
    "initial": "equilibrium", "model": "rod", "mesh": {"cells": 60},
    "time": {"duration": DURATION, "step": STEP}, "output": {"every": 0.1, "points": 61},
}  # fmt: skip


class Coupled(NamedTuple):
    """What the run of both leaves: the tether's result; by step: places (n, 3) m of vehicle and pile, tension (n, 2) N

    at both ends, wall time (n,) s of the tether's step and what belongs to it.
    """

    result: hybrid.Result
    vehicle: np.ndarray
    pile: np.ndarray
    tension: np.ndarray
    taken: np.ndarray


def wanted(t: float) -> np.ndarray:
    """Where the vehicle is to be at t (s), m: around the pile by 240 degrees, and back."""
    way = np.deg2rad(-37.0 + 240.0 * np.sin(np.pi * t / DURATION) ** 2)
    return np.asarray(PILE + 2.5 * np.array([np.cos(way), np.sin(way), 0.0]))


def main(duration: float = DURATION) -> Coupled:
    """Step both to the end, s."""
    import mujoco  # brought by hybrid-cable[mujoco]

    model = mujoco.MjModel.from_xml_string(WORLD)
    world = mujoco.MjData(model)
    mujoco.mj_forward(model, world)
    pile, vehicle = (model.body(name).id for name in ("pile", "vehicle"))
    rows = []
    with hybrid.Simulation(TETHER, most_iterations=4) as tether:
        while tether.t < duration - 0.5 * STEP:
            x, v = world.xpos[vehicle].copy(), world.qvel[2:5].copy()
            thrust = STIFF * (wanted(tether.t) - x) - DAMPED * v
            thrust *= min(1.0, STRONGEST / float(np.linalg.norm(thrust)))
            acting = tether.forces()
            world.xfrc_applied[vehicle, :3] = acting.end + thrust - DRAG * np.linalg.norm(v) * v
            world.xfrc_applied[pile, :3] = tether.obstacle("pile").force
            mujoco.mj_step(model, world)
            mujoco.mj_kinematics(model, world)  # places at the end of the step
            x, post = world.xpos[vehicle].copy(), world.xpos[pile].copy()
            begin = time.perf_counter()
            tether.set_end("end", x, world.qvel[2:5].copy())
            tether.set_obstacle("pile", post, (world.qvel[0], world.qvel[1], 0.0))
            tether.step()
            acting = tether.forces()
            taken = time.perf_counter() - begin
            rows.append((x, post, [np.linalg.norm(acting.start), np.linalg.norm(acting.end)], taken))
        result = tether.result()
    found = Coupled(result, *(np.array(column) for column in zip(*rows, strict=True)))
    pulled, late = found.pile - PILE, found.taken[1:]  # the first step fills caches
    print(f"{len(rows)} steps of {1e3 * STEP:g} ms: the tether takes {1e3 * np.median(late):.2f} ms in the median, "
          f"{1e3 * np.quantile(late, 0.999):.2f} ms in 99.9 %, {1e3 * late.max():.2f} ms in the worst")  # fmt: skip
    print(f"the pile gives way by {1e3 * np.linalg.norm(pulled, axis=1).max():.0f} mm; tension at the vehicle up to "
          f"{found.tension[:, 1].max():.0f} N, at the fixed point {found.tension[:, 0].max():.0f} N")  # fmt: skip
    return found


if __name__ == "__main__":
    main()
