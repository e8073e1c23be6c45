"""Contact of a line with itself in a correction of Newton's method: GMRES with the kept factors of the line.

Contact couples nodes that are no neighbours, which the block rows along s do not know.  It is added to their solution
x0 with the kept factors of the matrix A: (A - H) x = b + g is x = A^-1 b + A^-1 (g + H x), of which only the nodes in
contact are unknown; GMRES finds them, each product with A^-1 being one more substitution.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.kept_factors import carry_given, prepare_sweep, solve_backward, sweep
from hybrid.kernels.contact.self_contact_law import add_gradient, add_held, add_held_product, add_product
from hybrid.kernels.contact.self_contact_pairs import MOST_PRODUCTS
from hybrid.kernels.machine.compile import called, inner

# GMRES leaves a part of its first residual: PART_LEFT of the part that Newton's method leaves of the correction.
SOLVED = 1e-7  # at least this part
LARGEST_LEFT = 1e-3  # part, at most
PART_LEFT = 0.01
LEAST_LEFT = 1e-11  # diameters, at least


@inner
def find_forces(contact, with_gradient):
    """contact.y = H x + g of the nodes in contact, g where asked."""
    held_on = contact.numbers.friction > 0.0
    x, y = contact.x, contact.y
    for k in range(contact.counts.nodes):
        i = contact.nodes[k]
        y[i, 0], y[i, 1], y[i, 2], y[i, 3] = 0.0, 0.0, 0.0, 0.0
    for k in range(contact.counts.points):
        add_product(contact.points[k], x, y)
        if with_gradient:
            add_gradient(contact.points[k], y)
        if held_on:
            add_held_product(contact, k, x, y)
            if with_gradient:
                add_held(contact, k, y)


@inner
def enough(s, width, size):
    """Residual that GMRES may leave of the first, s (m), of `size` unknowns of lines of a diameter `width`, m."""
    scale = width * math.sqrt(size)
    return max(s * max(SOLVED, min(PART_LEFT * s / scale, LARGEST_LEFT)), LEAST_LEFT * scale)


@inner
def first_node(contact):
    """The first node in contact."""
    first = contact.nodes[0]
    for k in range(contact.counts.nodes):
        first = min(first, contact.nodes[k])
    return first


@called
def respond(ends, contact, work, with_gradient, begin):
    """contact.z = A^-1 (H x + g) from node `begin` on, g where asked; x of the nodes in contact."""
    find_forces(contact, with_gradient)
    y, z = contact.y, contact.z
    last = y.shape[0] - 1
    for k in range(contact.counts.nodes):
        i = contact.nodes[k]
        held = (i == 0 and ends.held[0] != 0) or (i == last and ends.held[1] != 0)
        z[i, 0] = 0.0
        for j in range(3):
            z[i, 1 + j] = 0.0 if held else y[i, j]
        z[i, 4] = y[i, 3] * contact.rolls[i]
    first = first_node(contact)
    for i in range(begin, first):
        for j in range(5):
            z[i, j] = 0.0
    if with_gradient:
        carry_given(work.X, work.W, contact.marks, z, False, first)
    else:
        sweep(work.X, work.W, contact.sweep, contact.marks, z, False, first)
    return solve_backward(work.X, z, begin)


@inner
def unknowns(contact):
    """Unknowns of a node in contact: its place, with friction the spin of the cell after it too, as a way."""
    return 4 if contact.numbers.friction > 0.0 and contact.numbers.rolls > 0.0 else 3


@inner
def length_of(contact, j, i):
    """Factor, m, of unknown j of node i: a spin (rad) counts by the radius."""
    return 0.5 * contact.width[i] if j == 3 else 1.0


@inner
def inner_product(a, b, size):
    """Of vectors, in four sums: one would wait for itself in every term."""
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    whole = size - size % 4
    for i in range(0, whole, 4):
        s0 += a[i] * b[i]
        s1 += a[i + 1] * b[i + 1]
        s2 += a[i + 2] * b[i + 2]
        s3 += a[i + 3] * b[i + 3]
    for i in range(whole, size):
        s0 += a[i] * b[i]
    return (s0 + s1) + (s2 + s3)


@inner
def next_vector(contact, k):
    """Orthogonalise basis vector k + 1 against those before; its length goes into the column k."""
    V, H, size = contact.basis, contact.hessenberg, unknowns(contact) * contact.counts.nodes
    new = V[k + 1]
    for j in range(k + 1):
        before = V[j]
        s = inner_product(before, new, size)
        H[j, k] = s
        for i in range(size):
            new[i] -= s * before[i]
    s = math.sqrt(inner_product(new, new, size))
    H[k + 1, k] = s
    if s > 0.0:
        for i in range(size):
            V[k + 1, i] /= s


@inner
def rotate_column(H, k):
    """Givens rotations of column k of the least-squares problem; the residual that is left."""
    cos, sin, rhs = MOST_PRODUCTS, MOST_PRODUCTS + 1, MOST_PRODUCTS + 2
    for j in range(k):
        a, b = H[j, k], H[j + 1, k]
        H[j, k], H[j + 1, k] = H[j, cos] * a + H[j, sin] * b, H[j, cos] * b - H[j, sin] * a
    a, b = H[k, k], H[k + 1, k]
    size = math.sqrt(a * a + b * b)
    H[k, cos], H[k, sin] = a / size, b / size
    H[k, k], H[k + 1, k] = size, 0.0
    H[k + 1, rhs] = -H[k, sin] * H[k, rhs]
    H[k, rhs] = H[k, cos] * H[k, rhs]
    return abs(H[k + 1, rhs])


@inner
def begin_columns(H, s):
    """The least-squares problem of a residual of length s, before the first product."""
    for i in range(MOST_PRODUCTS + 1):
        H[i, MOST_PRODUCTS + 2] = 0.0
    H[0, MOST_PRODUCTS + 2] = s


@inner
def solve_columns(H, done):
    """Its solution by so many products."""
    rhs, solution = MOST_PRODUCTS + 2, MOST_PRODUCTS + 3
    for j in range(done - 1, -1, -1):
        s = H[j, rhs]
        for k in range(j + 1, done):
            s -= H[j, k] * H[k, solution]
        H[j, solution] = s / H[j, j]


@inner
def combine_vectors(contact, H, done):
    """contact.x of the nodes in contact: the vectors of the basis with that solution."""
    per = unknowns(contact)
    for k in range(contact.counts.nodes):
        i = contact.nodes[k]
        for m in range(per):
            s = 0.0
            for j in range(done):
                s += H[j, MOST_PRODUCTS + 3] * contact.basis[j, per * k + m]
            contact.x[i, m] = s / length_of(contact, m, i)


@inner
def load_vector(contact, column):
    """contact.x = the basis vector of a column."""
    x, V, per = contact.x, contact.basis, unknowns(contact)
    for k in range(contact.counts.nodes):
        i = contact.nodes[k]
        for j in range(per):
            x[i, j] = V[column, per * k + j] / length_of(contact, j, i)


@inner
def find_solution(ends, contact, work):
    """GMRES: contact.x = the correction of the nodes in contact; False: not finite.

    It begins at zero, where the residual is A^-1 (b + g), which falls as Newton converges.  The correction x0 of a line
    without contact stays large, as the force of contact is left out of b: what SOLVED leaves of it would never fall.
    """
    x, z, V, H = contact.x, contact.z, contact.basis, contact.hessenberg
    count, per = contact.counts.nodes, unknowns(contact)
    begin = first_node(contact)
    prepare_sweep(work.X, work.W, contact.sweep, begin, contact.z.shape[0] - 1)
    for k in range(count):
        i = contact.nodes[k]
        for j in range(per):
            x[i, j] = 0.0
    if not respond(ends, contact, work, True, begin):
        return False
    s = 0.0
    for k in range(count):
        i = contact.nodes[k]
        for j in range(per):
            y = (work.x[i, 1 + j] + z[i, 1 + j]) * length_of(contact, j, i)
            V[0, per * k + j] = y
            s += y * y
    s = math.sqrt(s)
    begin_columns(H, s)
    done = 0
    if s > 0.0:
        for i in range(per * count):
            V[0, i] /= s
        left, most = s, enough(s, contact.numbers.widest, per * count)
        while done < min(MOST_PRODUCTS, per * count) and left > most:
            load_vector(contact, done)
            if not respond(ends, contact, work, False, begin):
                return False
            for k in range(count):
                i = contact.nodes[k]
                for j in range(per):
                    V[done + 1, per * k + j] = V[done, per * k + j] - z[i, 1 + j] * length_of(contact, j, i)
            next_vector(contact, done)
            left = rotate_column(H, done)
            done += 1
            contact.counts.products += 1
    solve_columns(H, done)
    combine_vectors(contact, H, done)
    return True


@inner
def solve_contact(ends, contact, work):
    """Put contact into the correction work.x of a line without it; False if it is not finite."""
    if not find_solution(ends, contact, work):
        return False
    if not respond(ends, contact, work, True, 0):
        return False
    z = contact.z
    for i in range(work.x.shape[0]):
        for j in range(5):
            work.x[i, j] += z[i, j]
    return True
