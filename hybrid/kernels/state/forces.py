"""The optional forces: bit in the mask of a line, and what each needs.

A force that no scene asked for has its bit off, and its parameters are never read.
"""

from __future__ import annotations

DRAG = 1
ADDED_MASS = 2
MASS_DAMPING = 4
STIFFNESS_DAMPING = 8
ROTARY = 16
FLOW = 32
WAVES = 64
SURFACE = 128
BODIES = 256
SEABED = 512
FRICTION = 1024
# No force: all of the cable and of what acts on it lies in a plane (hybrid.kernels.algebra.plane).
PLANAR = 2048
# Contact of the line with itself (hybrid.kernels.contact.self_contact).
SELF_CONTACT = 4096
SELF_FRICTION = 8192
# No force: tension that is no multiple of strain (hybrid.kernels.laws.axial_law).
AXIAL_LAW = 16384

# No force: the line may come to touch itself, which is computed from where it comes near itself on.
MAY_TOUCH = 32768
# Nor is this: it may come to touch other lines, which is computed from where it comes near one on.
MAY_MEET = 8388608

# Contact with obstacles (hybrid.kernels.laws.obstacles); what the line is pressed on by, bed or obstacles.
OBSTACLES = 65536
TOUCHES = SEABED | OBSTACLES
# No force: moment that is no multiple of curvature (hybrid.kernels.laws.bending_law).
BENDING_LAW = 131072
# Lift of vortices that follow the motion (hybrid.kernels.laws.vortices).
VORTICES = 262144
# No force: layers of a section that slip on each other as it bends (hybrid.kernels.laws.bending_slip).
BENDING_SLIP = 1048576
# Bed that remembers (hybrid.kernels.laws.soil): in place of the linear one; no force: friction that falls as a line slides.
SOIL = 2097152
BREAKOUT = 4194304
REMEMBERS = SOIL | BREAKOUT

FORCES = {
    "drag": (DRAG, "velocity, direction; environment.fluid and sections[].drag, or drag_area of modules"),
    "added mass": (ADDED_MASS, "acceleration, direction; environment.fluid and sections[].added_mass, or of modules"),
    "mass-proportional damping": (MASS_DAMPING, "velocity; sections[].damping.mass"),
    "stiffness-proportional damping": (STIFFNESS_DAMPING, "rate of strain; sections[].damping.stiffness"),
    "rotary inertia": (ROTARY, "turning of the cross-section; rod zones with a diameter or rotary_inertia"),
    "current": (FLOW, "height; environment.fluid.current"),
    "waves": (WAVES, "position, time; environment.fluid.waves"),
    "partly wetted cells at the surface": (SURFACE, "height; environment.fluid.surface"),
    "drag, added mass or wetting of bodies": (BODIES, "velocity, acceleration; cable.attachments, ends of kind body"),
    "lift of vortices": (VORTICES, "velocity, and a phase of its own; sections[].vortices"),
    "seabed contact": (SEABED, "height and its rate; environment.seabed"),
    "nonlinear soil": (SOIL, "height, and what it was before; environment.seabed.soil"),
    "seabed friction": (FRICTION, "travel along the seabed; environment.seabed.friction"),
    "friction that falls as the line slides": (BREAKOUT, "way along the seabed; environment.seabed.friction.residual"),
    "contact with obstacles": (OBSTACLES, "distance and its rate; obstacles"),
    "contact of the line with itself": (SELF_CONTACT, "distance of its parts; contact.self"),
    "friction of the line on itself": (SELF_FRICTION, "travel of its parts along each other; contact.friction"),
}
