"""Reduced-order observers with zonotopic residual bounds (method sheet `reduced_order_observer`, 4, joint mode).

All observers are one linear system: states z and centres c of all of them, outputs and commands are one vector, and one
product gives the next states, all residuals and all centres. Zonotopes of the start are one batch until they have
decayed; afterwards the half widths are those of the tables.
"""

import numpy as np
from peer import run

TOLERANCE_SHARE = 1e-3


class Observer:
    """Matrices and tables of one observer, in coordinates with C = [I 0]."""

    def __init__(self, plant, k, m, tests, decoupled, actuator):
        a, b, d, p = plant["a"], plant["b"], plant["d"], plant["p"]
        a11, a12, a21, a22 = a[:p, :p], a[:p, p:], a[p:, :p], a[p:, p:]
        a1 = a11 - a12 @ k
        self.noise_input = np.vstack([a1 - m, a21 - a22 @ k + k @ a1])
        self.a_e = np.block([[m, a12], [np.zeros((len(k), p)), a22 + k @ a12]])
        moved = lambda columns: np.vstack([columns[:p], columns[p:] + k @ columns[:p]])
        self.input, d_e = moved(b), moved(d)
        if actuator is not None:
            self.input[p:, actuator] = 0.0
        if decoupled:
            d_e[p:] = 0.0
        self.k, self.tests = k, tests
        self.shift = d_e @ plant["centre"]
        disturbance, noise = d_e * plant["radius"], np.diag(plant["noise"])
        # Half widths by age (3.7).
        piece = np.hstack([disturbance, -self.noise_input @ noise])
        width, widths = np.abs(tests * plant["noise"]).sum(axis=1), []
        size = plant["noise"].copy()
        while np.abs(piece).max() > 1e-14 * size.max() and len(widths) < 4096:
            size += np.abs(piece[:p]).sum(axis=1)
            widths.append(width)
            width = width + np.abs(tests @ piece[:p]).sum(axis=1)
            piece = self.a_e @ piece
        total, power = np.abs(piece).sum(axis=1).max(), self.a_e
        while np.abs(power).sum(axis=1).max() >= 1.0:
            piece, power = self.a_e @ piece, self.a_e @ power
            total += np.abs(piece).sum(axis=1).max()
        tail = total / (1.0 - np.abs(power).sum(axis=1).max())
        self.table = np.array([*widths, width + np.abs(tests).sum(axis=1) * tail])
        # H at the second instant, from the measured output at the first one.
        hidden = np.vstack([np.zeros((p, len(a))), np.diag(plant["start_radius"])[p:]])
        first = np.vstack([-noise, -k @ noise])
        self.start = np.hstack([self.a_e @ hidden, self.a_e @ first - self.noise_input @ noise, disturbance])


class Observers:
    def __init__(self, problem):
        tables, gains = problem["tables"], problem["gains"]
        model = tables["model"]
        read = lambda name: np.array(model[name], dtype=float)
        box = lambda name: (read(f"{name}_lower"), read(f"{name}_upper"))
        p = len(model["C"])
        assert np.array_equal(read("C"), np.eye(p, len(model["A"]))), "the example measures the first states"
        (low, high), (least, most) = box("disturbance"), box("initial_state")
        plant = {"a": read("A"), "b": read("B"), "d": read("D"), "p": p, "noise": read("measurement_noise_bound")}
        plant |= {"centre": (low + high) / 2, "radius": (high - low) / 2, "start_radius": (most - least) / 2}
        main, zero = gains["main"], np.zeros((p, p))
        array = lambda rows: np.array(rows, dtype=float)
        all_observers = [Observer(plant, array(main["K"]), array(main["M"]), array(main["W"]), True, None)]
        for one in gains.get("estimators", []):
            decoupled, actuator = one["decouples_disturbance"], one["actuator"]
            all_observers.append(Observer(plant, array(one["K"]), zero, array([one["phi"]]), decoupled, actuator))
        assert not gains.get("members"), "the example has one actuator"
        self.start_centre = (least + most)[p:] / 2
        n, m, count = len(plant["a"]), plant["b"].shape[1], len(all_observers)
        self.n, self.p, self.size = n, p, n * count
        # v = [z, c, y, u, 1]: the next z and c, the residuals and the centres are linear in it.
        size, rows = self.size, sum(len(one.tests) for one in all_observers)
        y0, u0, one0 = 2 * size, 2 * size + p, 2 * size + p + m
        whole = np.zeros((2 * size + 2 * rows, one0 + 1))
        # |w| (|y| + |z1|) of every row.
        sizes = np.zeros((rows, 2 * size + p))
        self.tests = np.zeros((count, max(len(one.tests) for one in all_observers), n))
        longest = max(len(one.table) for one in all_observers)
        table, row = [], 2 * size
        for place, one in enumerate(all_observers):
            z, c = slice(place * n, place * n + n), slice(size + place * n, size + place * n + n)
            whole[z, z], whole[z, y0:u0], whole[z, u0:one0] = one.a_e, one.noise_input, one.input
            whole[c, c], whole[c, one0] = one.a_e, one.shift
            part = slice(row, row + len(one.tests))
            whole[part, y0:u0], whole[part, z.start : z.start + p] = one.tests, -one.tests
            whole[rows + row : rows + part.stop, c.start : c.start + p] = one.tests
            share = slice(row - 2 * size, part.stop - 2 * size)
            sizes[share, y0:u0] = sizes[share, z.start : z.start + p] = np.abs(one.tests)
            self.tests[place, : len(one.tests), :p] = one.tests
            table.append(np.vstack([one.table, np.repeat(one.table[-1:], longest - len(one.table), axis=0)]))
            row = part.stop
        self.whole, self.table, self.rows = whole, np.hstack(table), rows
        self.used = np.concatenate([np.arange(len(one.tests)) + i * self.tests.shape[1] for i, one in enumerate(all_observers)])
        self.tolerance = tables["bounds"]["rounding_tolerance"]
        self.sizes = sizes * self.tolerance
        self.gains = np.vstack([one.k for one in all_observers])
        self.a_e = np.stack([one.a_e for one in all_observers])
        self.start = np.stack([one.start for one in all_observers])
        self.shifts = np.concatenate([one.shift for one in all_observers])
        self.hidden = n - p
        self.vector = np.zeros(one0 + 1)
        self.vector[-1] = 1.0
        self.y, self.u = self.vector[y0:u0], self.vector[u0:one0]
        self.result = np.empty(len(whole))
        self.state, self.next = self.vector[: 2 * size], self.result[: 2 * size]
        self.residual, self.centre = self.result[2 * size : 2 * size + rows], self.result[2 * size + rows :]
        self.magnitude, self.half_width = np.empty(2 * size + p), np.empty(rows)
        self.main_rows = len(all_observers[0].tests)
        estimators = count - 1
        self.channels = rows + 1 + estimators
        self.estimators = estimators
        self.out = np.zeros(2 * self.channels)

    def reset(self):
        self.started = False
        self.out[:] = 0.0

    def begin(self, y, u):
        """The first sample is the start."""
        n, p, state = self.n, self.p, self.state
        for place in range(self.size // n):
            z = state[place * n : place * n + n]
            z[:p] = y
            z[p:] = self.gains[place * self.hidden : (place + 1) * self.hidden] @ y + self.start_centre
        state[self.size :] = 0.0
        self.y[:], self.u[:] = y, u
        np.matmul(self.whole, self.vector, out=self.result)
        state[:] = self.next
        self.generators, self.age = self.start.copy(), 0

    def step(self, y, u):
        if not self.started:
            self.started = True
            self.begin(y, u)
            return
        self.y[:], self.u[:] = y, u
        np.matmul(self.whole, self.vector, out=self.result)
        half_width, used = self.half_width, self.used
        np.abs(self.vector[: len(self.magnitude)], out=self.magnitude)
        np.matmul(self.sizes, self.magnitude, out=half_width)
        half_width += self.table[self.age]
        half_width += self.tolerance
        if self.generators is not None:
            spread = np.abs(np.matmul(self.tests, self.generators)).sum(axis=2)
            half_width += spread.ravel()[used]
            self.generators = np.matmul(self.a_e, self.generators)
            if np.abs(self.generators).max() <= TOLERANCE_SHARE * self.tolerance:
                self.generators = None
        if self.age < len(self.table) - 1:
            self.age += 1
        self.write()
        self.state[:] = self.next

    def write(self):
        out, main, channels, count = self.out, self.main_rows, self.channels, self.rows
        residual, centre, half_width = self.residual, self.centre, self.half_width
        upper = centre + half_width
        estimate = residual[main:] - centre[main:]
        hull = slice(0, self.p)
        out[:main], out[channels : channels + main] = residual[:main], upper[:main]
        out[main] = (np.abs(residual[hull] - centre[hull]) - half_width[hull]).max()
        out[main + 1 : count + 1] = residual[main:]
        out[channels + main + 1 : channels + count + 1] = upper[main:]
        out[count + 1 : channels] = estimate
        out[channels + count + 1 :] = estimate + half_width[main:]


if __name__ == "__main__":
    run(Observers)
