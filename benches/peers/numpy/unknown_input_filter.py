"""The zonotopic unknown-input filter with a fixed gain (method sheet `unknown_input_filter`, 4.2 and 4.3).

Generators are stored as rows, so that appended blocks are contiguous. One product with the stacked matrix
[(I - LC); WC; phi C] A0 gives the corrected generators and the spread of all test rows; one sum of magnitudes gives
their half widths and the radius of the set, which the reduction does not change.
"""

import numpy as np
from peer import run


class FixedGainFilter:
    def __init__(self, problem):
        model = problem["tables"]["model"]
        a, b, c = (np.array(model[name], dtype=float) for name in "ABC")
        self.a_plus = np.array(model["A_uncertainty"], dtype=float)
        self.w = np.array(model["disturbance_bound"], dtype=float)
        v = np.array(model["measurement_noise_bound"], dtype=float)
        self.p0 = np.array(model["initial_state_center"], dtype=float)
        self.h0 = np.diag(np.array(model["initial_state_radius"], dtype=float))
        self.gain = np.array(problem["gains"]["mode"][0]["L_fix"])
        self.order = problem["tables"]["filter"]["generator_order"]
        (nx, nu), ny = b.shape, len(c)
        self.nx = nx
        # Off-line: the decoupled test rows and the row of the estimate for the settled spread.
        cf = c @ b
        left_inverse = np.linalg.pinv(cf)
        projector = np.eye(ny) - cf @ left_inverse
        basis = np.linalg.svd(projector)[0][:, : ny - nu]
        spread = self.settled_spread(a, b, c, v, projector)
        psi = spread @ spread.T + np.diag(v**2)
        k = basis.T @ psi @ basis
        estimate = left_inverse - left_inverse @ psi @ basis @ np.linalg.solve(k, basis.T)
        self.rows = np.vstack([projector, estimate])
        weights = np.vstack([self.gain, self.rows])
        maps = np.vstack([np.eye(nx) - self.gain @ c, self.rows @ c])
        # Room for one step; the noise block never changes.
        columns = self.order + nx + ny
        count = nx + len(self.rows)
        self.ab = np.hstack([a, b])
        self.c = c
        self.stacked = np.ascontiguousarray((maps @ a).T)
        self.maps = np.ascontiguousarray(maps.T)
        self.noise = (weights * v).T
        self.sizes = np.empty((columns, count))
        self.sums = np.empty(count)
        self.product = np.empty((columns, count))
        self.scaled = np.empty((columns, nx))
        self.scores = np.empty(columns)
        self.largest = np.empty(columns)
        self.generators = np.zeros((self.order, nx))
        self.state = np.empty(nx + nu)
        self.magnitude = np.empty(nx)
        self.box = np.empty(nx)
        self.centre = np.empty(nx)
        self.innovation = np.empty(ny)
        self.correction = np.empty(nx)
        self.radius = np.empty(nx)
        self.out = np.zeros(2 * len(self.rows))
        self.residuals, self.bounds = self.out[: len(self.rows)], self.out[len(self.rows) :]

    def settled_spread(self, a, b, c, v, projector, steps=2000):
        """C G of the set that this filter settles at with x = 0 and no innovation."""
        h = self.h0
        project = np.eye(self.nx) - self.gain @ c
        for _ in range(steps):
            box = self.a_plus @ np.abs(h).sum(axis=1) + self.w
            g = np.hstack([a @ h, np.diag(box)])
            h = np.hstack([project @ g, self.gain * v])
            if h.shape[1] > self.order:
                scaled = np.abs(h) / np.abs(h).sum(axis=1, keepdims=True)
                kept = np.sort(np.argsort(-(scaled.sum(0) - scaled.max(0)), kind="stable")[: self.order - self.nx])
                rest = np.delete(h, kept, axis=1)
                h = np.hstack([h[:, kept], np.diag(np.abs(rest).sum(axis=1))])
        return c @ g

    def reset(self):
        self.started = False
        self.count = self.nx
        self.generators[: self.nx] = self.h0
        self.radius[:] = np.abs(self.h0).sum(axis=1)
        self.state[: self.nx] = self.p0
        self.out[:] = 0.0

    def step(self, y, u):
        nx, state, box, out = self.nx, self.state, self.box, self.product
        if not self.started:
            # Instant 0 gives the command of the first transition only.
            self.started = True
            state[nx:] = u
            return
        # Steps 1 to 3: prediction and innovation.
        np.abs(state[:nx], out=self.magnitude)
        self.magnitude += self.radius
        np.matmul(self.a_plus, self.magnitude, out=box)
        box += self.w
        np.matmul(self.ab, state, out=self.centre)
        np.matmul(self.c, self.centre, out=self.innovation)
        np.subtract(y, self.innovation, out=self.innovation)
        # [G - L Gamma, LV] and the same for the test rows, as rows.
        r = self.count
        total = r + nx + len(self.noise)
        np.matmul(self.generators[:r], self.stacked, out=out[:r])
        np.multiply(self.maps, box[:, None], out=out[r : r + nx])
        out[r + nx : total] = self.noise
        sizes = self.sizes[:total]
        np.abs(out[:total], out=sizes)
        np.add.reduce(sizes, axis=0, out=self.sums)
        # Steps 6 and 7: residuals, half widths, the estimate with its radius.
        np.matmul(self.rows, self.innovation, out=self.residuals)
        self.bounds[:] = self.sums[nx:]
        self.bounds[-1] += self.residuals[-1]
        # Step 8: correction and reduction.
        np.matmul(self.gain, self.innovation, out=self.correction)
        np.add(self.centre, self.correction, out=state[:nx])
        state[nx:] = u
        self.radius[:] = self.sums[:nx]
        self.reduce(total)

    def reduce(self, total):
        nx, order = self.nx, self.order
        if total <= order:
            self.generators[:total] = self.product[:total, :nx]
            self.count = total
            return
        scaled, scores, largest = self.scaled[:total], self.scores[:total], self.largest[:total]
        np.divide(self.sizes[:total, :nx], self.radius, out=scaled)
        np.add.reduce(scaled, axis=1, out=scores)
        np.maximum.reduce(scaled, axis=1, out=largest)
        scores -= largest
        dropped = total - (order - nx)
        parted = scores.argpartition(dropped)
        kept = parted[dropped:]
        self.generators[: order - nx] = self.product[kept, :nx]
        rest = self.sizes[parted[:dropped], :nx].sum(axis=0)
        box = self.generators[order - nx :]
        box[:] = 0.0
        box.ravel()[:: nx + 1] = rest
        self.count = order


if __name__ == "__main__":
    run(FixedGainFilter)
