"""A bank of zonotopic unknown-input filters with row-wise gains (method sheet `unknown_input_filter`, 4.2 and 4.3).

Generators and their images are stored as rows; the noise block stands below the spread, so that one sum of magnitudes
gives |W Gamma| + |W| v of all rows at once.
"""

import numpy as np
from peer import run


class Filter:
    """One mode: the actuators in `own` may have any fault."""

    def __init__(self, model, options, own, l_fix):
        read = lambda name: np.array(model[name], dtype=float)
        a, b, c = read("A"), read("B"), read("C")
        self.a_plus, self.w, v = read("A_uncertainty"), read("disturbance_bound"), read("measurement_noise_bound")
        self.p0, self.h0 = read("initial_state_center"), np.diag(read("initial_state_radius"))
        self.order = options["generator_order"]
        (nx, nu), ny = b.shape, len(c)
        f = b[:, own]
        cf = c @ f
        self.left_inverse = np.linalg.pinv(cf) if own else np.zeros((0, ny))
        self.l0 = f @ self.left_inverse
        self.projector = np.eye(ny) - cf @ self.left_inverse
        self.basis = np.linalg.svd(self.projector)[0][:, : ny - len(own)]
        others = [j for j in range(nu) if j not in own]
        self.signatures = (c @ b)[:, others]
        inverse = np.linalg.pinv(c)
        self.strip_rows = (inverse - self.l0) @ self.basis
        self.strip_widths = np.abs(inverse) @ v
        differs = l_fix is not None and np.abs(l_fix - inverse).max() > 1e-9 * np.abs(inverse).max()
        self.fixed_rows = (l_fix - self.l0) @ self.basis if differs else None
        # Room for one step.
        self.a_t, self.c, self.c_t = a.T.copy(), c, c.T.copy()
        self.ab = np.hstack([a, b])
        self.nx, self.ny, self.v = nx, ny, v
        columns = self.order + nx
        self.generators = np.zeros((columns + ny, nx))
        self.spread = np.zeros((columns + ny, ny))
        self.h = np.zeros((self.order, nx))
        self.state = np.empty(nx + nu)
        self.magnitude, self.box, self.centre = np.empty(nx), np.empty(nx), np.empty(nx)
        self.innovation, self.radius = np.empty(ny), np.empty(nx)
        self.fixed_count = ny + len(others)
        self.rows = np.zeros((self.fixed_count + len(own), ny))
        self.rows[:ny] = self.projector
        self.residuals, self.bounds = np.zeros(len(self.rows)), np.zeros(len(self.rows))

    def reset(self):
        self.count = self.nx
        self.h[: self.nx] = self.h0
        self.radius[:] = np.abs(self.h0).sum(axis=0)
        self.state[: self.nx] = self.p0
        self.residuals[:] = self.bounds[:] = 0.0

    def step(self, y):
        nx, ny, r = self.nx, self.ny, self.count
        # Steps 1 to 3.
        np.abs(self.state[:nx], out=self.magnitude)
        self.magnitude += self.radius
        np.matmul(self.a_plus, self.magnitude, out=self.box)
        self.box += self.w
        np.matmul(self.ab, self.state, out=self.centre)
        np.matmul(self.c, self.centre, out=self.innovation)
        np.subtract(y, self.innovation, out=self.innovation)
        q = r + nx
        generators, spread = self.generators[: q + ny], self.spread[: q + ny]
        np.matmul(self.h[:r], self.a_t, out=generators[:r])
        generators[r:] = 0.0
        generators[r:q].ravel()[:: nx + 1] = self.box
        np.matmul(generators[:q], self.c_t, out=spread[:q])
        spread[q:] = 0.0
        spread[q:].ravel()[:: ny + 1] = self.v
        # Steps 4 and 5: the best row of S' among Frobenius, strip and fixed gain.
        based = spread @ self.basis
        inverse = np.linalg.inv(based.T @ based)
        rest = generators - spread @ self.l0.T
        coefficients = rest.T @ based @ inverse
        least = np.abs(rest - based @ coefficients.T).sum(axis=0)
        narrower = self.strip_widths < least
        coefficients[narrower] = self.strip_rows[narrower]
        if self.fixed_rows is not None:
            least = np.minimum(least, self.strip_widths)
            narrower = np.abs(rest - based @ self.fixed_rows.T).sum(axis=0) < least
            coefficients[narrower] = self.fixed_rows[narrower]
        gain = self.l0 + coefficients @ self.basis.T
        # Steps 6 and 7: projector rows, matched rows, estimates.
        rows = self.rows
        matched = self.basis @ (inverse @ (self.basis.T @ self.signatures))
        matched /= np.sqrt(np.square(matched).sum(axis=0))
        rows[ny : self.fixed_count] = matched.T
        if self.fixed_count < len(rows):
            own = spread @ self.left_inverse.T
            rows[self.fixed_count :] = self.left_inverse - own.T @ based @ inverse @ self.basis.T
        np.matmul(rows, self.innovation, out=self.residuals)
        np.abs(spread @ rows.T).sum(axis=0, out=self.bounds)
        self.bounds[self.fixed_count :] += self.residuals[self.fixed_count :]
        # Step 8.
        self.state[:nx] = self.centre + gain @ self.innovation
        self.reduce(generators - spread @ gain.T)

    def reduce(self, h):
        nx, order = self.nx, self.order
        sizes = np.abs(h)
        sizes.sum(axis=0, out=self.radius)
        if len(h) <= order:
            self.h[: len(h)] = h
            self.count = len(h)
            return
        scaled = sizes / self.radius
        scores = scaled.sum(axis=1) - scaled.max(axis=1)
        dropped = len(h) - (order - nx)
        parted = scores.argpartition(dropped)
        self.h[: order - nx] = h[parted[dropped:]]
        box = self.h[order - nx :]
        box[:] = 0.0
        box.ravel()[:: nx + 1] = sizes[parted[:dropped]].sum(axis=0)
        self.count = order


class Bank:
    def __init__(self, problem):
        tables = problem["tables"]
        gains = {tuple(one["mode"]): one.get("L_fix") for one in problem["gains"].get("mode", [])}
        actuators = len(tables["model"]["B"][0])
        self.filters = []
        for own in [(), *((j,) for j in range(actuators))]:
            l_fix = gains.get(own)
            l_fix = None if l_fix is None else np.array(l_fix)
            self.filters.append(Filter(tables["model"], tables["filter"], list(own), l_fix))

    def reset(self):
        self.started = False
        for one in self.filters:
            one.reset()

    def step(self, y, u):
        for one in self.filters:
            if self.started:
                one.step(y)
            one.state[one.nx :] = u
        self.started = True

    @property
    def out(self):
        """Read where the numbers are compared, not in every timed step."""
        return np.concatenate([one.residuals for one in self.filters] + [one.bounds for one in self.filters])


if __name__ == "__main__":
    run(Bank)
