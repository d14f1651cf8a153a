"""Chi-square tests, window bank, likelihood ratio and cumulative sums (method sheet `chi_square`, 4).

The square-root filter is one QR factorisation a step, of [L_R, H Phi L_P, H G; 0, Phi L_P, G] transposed; all onsets and
modes of the likelihood ratio are columns of one matrix; all windows come from one pass over a ring with powers of Phi and one batch
of singular value decompositions.
"""

from math import erfc, exp, pi, sqrt

import numpy as np
from peer import run


def upper_tail(x, degrees):
    """Of the chi-square distribution, for up to three degrees of freedom."""
    if degrees == 2:
        return exp(-x / 2)
    one = erfc(sqrt(x / 2))
    return one if degrees == 1 else one + sqrt(2 * x / pi) * exp(-x / 2)


def quantile(probability, degrees):
    low, high = 0.0, 200.0
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if upper_tail(middle, degrees) > probability else (low, middle)
    return (low + high) / 2


class ChiSquare:
    def __init__(self, problem):
        tables = problem["tables"]
        model = tables["model"]
        read = lambda name: np.array(model[name], dtype=float)
        self.phi, self.b, self.h = read("transition"), read("input"), read("measurement")
        gamma, q, r = read("process_noise_input"), read("process_noise_covariance"), read("measurement_noise_covariance")
        (n, m), noises = self.h.shape[::-1], gamma.shape[1]
        self.n, self.m = n, m
        noise = gamma @ np.linalg.cholesky(q)
        self.x0 = np.array(model.get("initial_state") or np.zeros(n), dtype=float)
        self.l0 = np.linalg.cholesky(read("initial_covariance"))
        # One factorisation predicts and corrects: L_P- = [Phi L_P, G] need not be triangular itself.
        self.array = np.zeros((m + n + noises, m + n))
        self.array[:m, :m] = np.linalg.cholesky(r).T
        self.array[m + n :, :m] = (self.h @ noise).T
        self.array[m + n :, m:] = noise.T
        self.moved = np.hstack([(self.h @ self.phi).T, self.phi.T])
        # Windows: powers of Phi, and which instants belong to which window.
        self.windows = tables["statistics"]["window_steps"]
        longest = max(self.windows)
        self.longest = longest
        self.powers = np.stack([np.linalg.matrix_power(self.phi, i) for i in range(longest)])
        self.belongs = np.zeros((len(self.windows), longest))
        for row, steps in zip(self.belongs, self.windows):
            row[:steps] = 1.0
        self.last = np.array(self.windows) - 1
        self.tolerance = tables["numerics"]["rank_tolerance"]
        # Likelihood ratio: columns are onset by onset [step of every sensor, ramp of every sensor].
        glr = tables["glr"]
        self.onsets, self.modes = glr["window_steps"], 2 * m
        columns = self.onsets * self.modes
        self.direction = np.tile(np.eye(m), 2 * self.onsets)
        self.ramp = np.tile(np.repeat([0.0, 1.0], m), self.onsets)
        self.reference = tables["cusum"]["reference"]
        # Thresholds.
        threshold = tables["threshold"]
        p = threshold["false_alarm_probability"]
        self.deviations = sqrt(quantile(p, 1))
        self.residual_bound = quantile(p, m)
        bounds = [np.inf] + [quantile(p / len(self.windows), d) for d in range(1, n + 1)]
        self.window_bounds = np.array(bounds)
        self.glr_bound, self.cusum_bound = threshold["glr"], threshold["cusum"]
        # Room.
        self.ring_gain = np.zeros((2 * longest, n, m))
        self.ring_correction = np.zeros((2 * longest, n))
        self.pieces = np.empty((longest, n, m))
        self.shifts = np.empty((longest, n))
        self.masked = np.empty((len(self.windows), longest, n, m))
        self.right = np.empty((m, 1 + columns))
        self.signature = np.empty((m, columns))
        self.sensitivity = np.zeros((n, columns))
        self.delta = np.empty((n, columns))
        self.score, self.energy = np.zeros(columns), np.zeros(columns)
        self.amplitude, self.growth = np.zeros(columns), np.zeros(columns)
        self.ratio = np.zeros(columns)
        self.sums = np.zeros((2, m))
        channels = m + n + 1 + len(self.windows) + 1 + 1 + m + 1 + len(self.windows) + 3
        self.out = np.zeros(2 * channels)
        self.channels = channels

    def reset(self):
        self.started = False
        self.x, self.factor = self.x0.copy(), self.l0.copy()
        self.previous = None
        self.place, self.count = self.longest, 0
        self.steps = 0
        for room in (self.ring_gain, self.ring_correction, self.sensitivity, self.score, self.energy):
            room[:] = 0.0
        for room in (self.amplitude, self.growth, self.sums, self.out):
            room[:] = 0.0

    def step(self, z, u):
        if not self.started:
            self.started, self.previous = True, u
            return
        n, m = self.n, self.m
        # Steps 2 to 5: prediction, update array, whitening.
        x = self.phi @ self.x
        x += self.b @ self.previous
        self.previous = u
        np.matmul(self.factor.T, self.moved, out=self.array[m : m + n])
        lower = np.linalg.qr(self.array, mode="r").T
        innovation_factor, gain = lower[:m, :m], lower[m:, :m]
        self.factor = lower[m:, m:]
        innovation = z - self.h @ x
        e, best = self.likelihood_ratio(innovation, innovation_factor, gain)
        correction = gain @ e
        x += correction
        self.x = x
        deviation = np.sqrt(np.square(innovation_factor).sum(axis=1))
        windows = self.window_bank(gain, correction)
        # Step 9: cumulative sums.
        normalised = innovation / deviation
        sums = self.sums
        sums[0] += normalised
        sums[1] -= normalised
        sums -= self.reference
        np.maximum(sums, 0.0, out=sums)
        signed = np.where(sums[0] >= sums[1], sums[0], -sums[1])
        self.write(innovation, deviation, e @ e, windows, best, signed)

    def likelihood_ratio(self, innovation, factor, gain):
        """Step 9: opens the onset of this instant; returns e and the best column."""
        modes, amplitude = self.modes, self.amplitude
        begin = self.steps % self.onsets * modes
        self.steps += 1
        slot = slice(begin, begin + modes)
        amplitude += self.growth
        amplitude[slot] = 1.0
        self.growth[slot] = self.ramp[slot]
        self.sensitivity[:, slot] = 0.0
        self.score[slot] = 0.0
        self.energy[slot] = 0.0
        np.matmul(self.phi, self.sensitivity, out=self.delta)
        right = self.right
        right[:, 0] = innovation
        np.multiply(self.direction, amplitude, out=right[:, 1:])
        right[:, 1:] -= self.h @ self.delta
        solved = np.linalg.solve(factor, right)
        e, g = solved[:, 0], solved[:, 1:]
        np.matmul(gain, g, out=self.sensitivity)
        self.sensitivity += self.delta
        self.score += e @ g
        np.square(g, out=self.signature)
        self.energy += self.signature.sum(axis=0)
        self.ratio[:] = 0.0
        np.divide(np.square(self.score), self.energy, out=self.ratio, where=self.energy > 1e-12)
        return e, int(self.ratio.argmax())

    def window_bank(self, gain, correction):
        """Steps 7 and 8 for all windows at once: statistics, degrees, beta and deviations of the longest one."""
        longest = self.longest
        # Newest first, without moving: every entry is written twice, `longest` apart.
        self.place = self.place - 1 if self.place > 0 else longest - 1
        place = self.place
        self.ring_gain[place] = self.ring_gain[place + longest] = gain
        self.ring_correction[place] = self.ring_correction[place + longest] = correction
        np.matmul(self.powers, self.ring_gain[place : place + longest], out=self.pieces)
        np.matmul(self.powers, self.ring_correction[place : place + longest, :, None], out=self.shifts[..., None])
        beta = -np.cumsum(self.shifts, axis=0)[self.last]
        np.multiply(self.pieces, self.belongs[:, :, None, None], out=self.masked)
        factors = self.masked.transpose(0, 2, 1, 3).reshape(len(self.windows), self.n, -1)
        scale = np.sqrt(np.square(factors).sum(axis=2))
        deviation = scale[-1].copy()
        scale[scale == 0.0] = 1.0
        left, values, _ = np.linalg.svd(factors / scale[..., None], full_matrices=False)
        kept = values > self.tolerance * values[:, :1]
        projected = np.matmul((beta / scale)[:, None], left)[:, 0]
        parts = np.divide(projected, values, out=np.zeros_like(values), where=kept)
        return np.square(parts).sum(axis=1), kept.sum(axis=1), beta[-1], deviation

    def write(self, innovation, deviation, residual, windows, best, signed):
        statistics, degrees, beta, spread = windows
        bounds = self.window_bounds[degrees]
        size, error = self.score[best] / self.energy[best], 1.0 / sqrt(self.energy[best])
        slot, mode = divmod(best, self.modes)
        age = (self.steps - 1 - slot) % self.onsets
        numbers = np.concatenate
        self.out[: self.channels] = numbers(
            [innovation, beta, [residual], statistics, [(statistics / bounds).max()], [self.ratio[best]], signed]
            + [[self.m], degrees, [size, age, mode]]
        )
        most, count = max(self.n, self.m), len(degrees)
        self.out[self.channels :] = numbers(
            [self.deviations * deviation, self.deviations * spread, [self.residual_bound], bounds, [1.0, self.glr_bound]]
            + [[self.cusum_bound] * self.m, [most] * (1 + count), [size + error, self.onsets - 1, mode]]
        )


if __name__ == "__main__":
    run(ChiSquare)
