"""The fault detection filter with guaranteed thresholds (method sheet `hinf_filter`, 4.1, discrete observer).

One product gives residuals and next state; the three windows (residuals, bounds, initial error) are one ring.
"""

import numpy as np
from imm_model import exponential
from peer import run


def largest_gain(a, b, c, d):
    """The H-infinity norm of a stable discrete-time system: the maximum over the unit circle, refined."""

    def gain(angle):
        return np.linalg.norm(c @ np.linalg.solve(np.exp(1j * angle) * np.eye(len(a)) - a, b) + d, 2)

    angles = np.concatenate([[0.0], np.geomspace(1e-6, np.pi, 2000)])
    best = int(np.argmax([gain(angle) for angle in angles]))
    low, high = angles[max(best - 1, 0)], angles[min(best + 1, len(angles) - 1)]
    for _ in range(100):
        left, right = low + (high - low) * 0.382, low + (high - low) * 0.618
        low, high = (low, right) if gain(left) > gain(right) else (left, high)
    return max(gain((low + high) / 2), gain(0.0), gain(np.pi))


def memory(a, b, c, samples):
    """mu of the windows before (3.7)."""

    def root(matrix):
        values, vectors = np.linalg.eigh(matrix)
        return vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T

    seen, reached, power = np.zeros_like(a), np.zeros_like(a), np.eye(len(a))
    for _ in range(samples):
        seen += power.T @ c.T @ c @ power
        reached += power @ b @ b.T @ power.T
        power = a @ power
    left, right, moved, total = root(seen), root(reached), np.eye(len(a)), 0.0
    first = np.linalg.norm(left @ right, 2)
    while (part := np.linalg.norm(left @ moved @ right, 2)) > 1e-14 * first:
        total, moved = total + part, moved @ power
    return total


def peak_gain(a, b, c, d):
    """The l1 norm, entry by entry."""
    total, reached, first = np.abs(d), b, np.abs(b).max()
    while np.abs(reached).max() > 1e-16 * first:
        total = total + np.abs(c @ reached)
        reached = a @ reached
    return total


class Filter:
    def __init__(self, problem):
        tables = problem["tables"]
        model, step = tables["model"], problem["sample_time_s"]
        a, b, c, d, bd, dd = (np.array(model[name], dtype=float) for name in ("A", "B", "C", "D", "Bd", "Dd"))
        gain, v = (np.array(problem["gains"]["main"][name], dtype=float) for name in "LV")
        n, p, m, q = len(a), b.shape[1], bd.shape[1], len(c)
        block = np.zeros((n + p + m,) * 2)
        block[:n] = np.hstack([a, b, bd]) * step
        moved = exponential(block)
        ad, bud, bdd = moved[:n, :n], moved[:n, n : n + p], moved[:n, n + p :]
        self.closed = ad - gain @ c
        e, self.output, f = bdd - gain @ dd, v @ c, v @ dd
        amplitude = np.array(tables["disturbance"]["amplitude"], dtype=float)
        samples = round(tables["evaluation"]["window"] / step)
        self.peak = peak_gain(self.closed, e, self.output, f) @ amplitude
        length = np.sqrt(samples * step)
        both = lambda j: largest_gain(self.closed, e[:, j], self.output, f[:, j]) + memory(
            self.closed, e[:, j], self.output, samples
        )
        together = both(slice(None)) * length * np.linalg.norm(amplitude)
        single = sum(both([j]) * length * amplitude[j] for j in range(m))
        self.energy = min(together, single)
        # The start: one output tells the state.
        self.inverse = np.linalg.pinv(c)
        self.feedthrough = d
        self.initial_error = np.abs(self.inverse) @ np.abs(dd) @ amplitude
        # [V r; next x] from [x; y; u].
        self.whole = np.block([[-self.output, v, -v @ d], [self.closed, gain, bud - gain @ d]])
        self.vector = np.zeros(n + q + p)
        self.x, self.y, self.u = self.vector[:n], self.vector[n : n + q], self.vector[n + q :]
        self.result = np.empty(len(v) + n)
        self.residual, self.next = self.result[: len(v)], self.result[len(v) :]
        self.step_s, self.samples = step, samples
        self.ring = np.empty((samples, 3))
        self.running, self.fresh = np.empty(3), np.empty(3)
        self.values, self.roots = np.empty((3, len(v))), np.empty(3)
        self.bound = np.empty(len(v))
        self.out = np.zeros(2 * (1 + len(v)))
        self.count = 1 + len(v)

    def reset(self):
        self.started = False
        self.ring[:] = 0.0
        self.running[:] = 0.0
        self.fresh[:] = 0.0
        self.place = 0
        self.response = self.output
        self.values[:] = 0.0

    def step(self, y, u):
        self.y[:], self.u[:] = y, u
        if not self.started:
            self.started = True
            self.x[:] = self.inverse @ (y - self.feedthrough @ u)
        np.matmul(self.whole, self.vector, out=self.result)
        values, running, bound = self.values, self.running, self.bound
        values[0] = self.residual
        if self.response is not None:
            values[2] = np.abs(self.response) @ self.initial_error
            if (values[2] < 1e-12 * self.peak).all():
                self.response = None
            else:
                self.response = self.response @ self.closed
        np.add(self.peak, values[2], out=bound)
        values[1] = bound
        squares = np.einsum("ij,ij->i", values, values)
        if self.response is None:
            values[2] = 0.0
        # The windows, exact again after every turn.
        oldest = self.ring[self.place]
        running += squares
        running -= oldest
        self.fresh += squares
        oldest[:] = squares
        self.place += 1
        if self.place == self.samples:
            running[:] = self.fresh
            self.fresh[:] = 0.0
            self.place = 0
        np.maximum(running, 0.0, out=self.roots)
        self.roots *= self.step_s
        energy, by_samples, initial = np.sqrt(self.roots)
        out, count = self.out, self.count
        out[0], out[count] = energy, min(by_samples, self.energy + initial)
        out[1:count], out[count + 1 :] = self.residual, bound
        self.x[:] = self.next


if __name__ == "__main__":
    run(Filter)
