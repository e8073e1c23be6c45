"""What a step reports beside its state: one array of numbers, each with its name here.

The assembly of every iteration clears and writes the first `ASSEMBLED` numbers, the step the others.

    name                      meaning                                                          unit
    FORCE_A, FORCE_B          force of the line on what holds, carries or loads its start, its
                              end (kernels.laws.end_forces), 3 numbers                              N
    MOMENT_A, MOMENT_B        moment at the start and at the end, 3 numbers                    N m
    DRAG_POWER                power of the drag                                                W
    MASS_DAMPING_POWER        power lost to damping proportional to mass                       W
    STIFFNESS_DAMPING_POWER   power lost to damping proportional to stiffness                  W
    RESIDUAL, RESIDUAL_NODE   largest residual force, and its node                             N, -
    ADDED_MASS_POWER          power into the added mass                                        W
    WAVE_POWER                power of the waves, and of buoyancy at the surface               W
    CONTACT_WORK              work of the seabed along its normal in the step                  J
    FRICTION_WORK             work of the seabed in its plane in the step                      J
    CONTACT_FORCE             force of the seabed along its normal                             N
    BEND, BEND_NODE           largest bend of an element, and its node (-1: none)              rad, -
    TWIST, TWIST_NODE         largest twist of an element, and its node (-1: none)             rad, -
    SLACKEST, SLACKEST_CELL   lowest tension of a catenary cell, and that cell                 N, -
    SEABED_ENERGY             energy that the seabed stores                                    J
    PUSH_ENERGY               kinetic energy of the push out of the plane                      J
    WRONG_PIVOTS              how many pivots of the push's equations have the wrong sign      -
    LOCAL_ERROR, ..._NODE     local error of position that the step makes, and its node        m, -
    SELF_CONTACT_ENERGY       energy of the contact of the line with itself                    J
    SELF_FRICTION_WORK        work of its friction in the step, and what that has stored more  J
    LENGTH_OUT, PAYOUT_RATE   unstretched length of a line that is paid out, and its rate      m, m/s
    PAYOUT_POWER              power of the winch on the line                                   W
    STRETCH_ENERGY            energy of stretch where an axial law is no straight line         J
    USED_RHO                  spectral radius at infinity of the step                          -
    NET_A, NET_B              resultant on the node at the start and at the end, 3 numbers     N
    OBSTACLE_WORK             work of obstacles as they move, in the step                      J
    LOST_WORK                 work of what ropes that remember a tension, and layers that slip,
                              lose in the step                                                 J
"""

from __future__ import annotations

FORCE_A = 0
FORCE_B = 3
MOMENT_A = 6
MOMENT_B = 9
DRAG_POWER = 12
MASS_DAMPING_POWER = 13
STIFFNESS_DAMPING_POWER = 14
RESIDUAL, RESIDUAL_NODE = 15, 16
ADDED_MASS_POWER, WAVE_POWER = 17, 18
CONTACT_WORK = 19
FRICTION_WORK = 20
CONTACT_FORCE = 21
ASSEMBLED = 22
BEND = 22
BEND_NODE = 23
TWIST = 24
TWIST_NODE = 25
SLACKEST, SLACKEST_CELL = 26, 27
SEABED_ENERGY = 28
PUSH_ENERGY, WRONG_PIVOTS = 29, 30
LOCAL_ERROR, LOCAL_ERROR_NODE = 31, 32
SELF_CONTACT_ENERGY, SELF_FRICTION_WORK = 33, 34
LENGTH_OUT = 35
PAYOUT_RATE = 36
PAYOUT_POWER = 37
STRETCH_ENERGY = 38
USED_RHO = 39
NET_A, NET_B = 40, 43
OBSTACLE_WORK = 46
LOST_WORK = 47
REPORT_SIZE = 48


# The optional forces: bit in the mask of a line, and what each needs.
#
# A force that no scene asked for has its bit off, and its parameters are never read.

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
