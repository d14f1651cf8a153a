"""Asynchronous interacting multiple models (method sheet `async_imm`, 4.2, sequential Joseph form).

All modes are one batch: states (M, n), covariances (M, n, n), pairs of modes (M, M, n). The sensors' times repeat with
the period, so that the plant over every interval is computed once.
"""

import numpy as np
from imm_model import Plant
from peer import run


class Estimator:
    def __init__(self, problem):
        tables = problem["tables"]
        plant = Plant(tables)
        nx, slots = plant.nx, plant.slots
        modes, n = len(plant.directions), nx + slots
        self.modes, self.n = modes, n
        self.mean0, self.spread0 = plant.prior(tables)
        self.mu0 = np.array(tables["initial"]["mode_probability"], dtype=float)
        self.transition = np.array(tables["transition"]["matrix"], dtype=float)
        # Which states are carried from mode i to mode m, and what the others restart with.
        carried = np.ones((modes, modes, n))
        if tables["amplitude"]["mixing"] != "all":
            for i, left in enumerate(plant.directions):
                for m, right in enumerate(plant.directions):
                    shared = (left == right).all(axis=0) & left.any(axis=0)
                    carried[i, m, nx:] = shared
        self.all_carried = carried.all()
        self.carried = carried
        self.carried_pairs = carried[..., :, None] * carried[..., None, :]
        self.restart_mean = (1 - carried) * self.mean0
        restart = (1 - carried)[..., :, None] * (1 - carried)[..., None, :]
        self.restart_spread = restart * self.spread0
        # One prediction and one sensor after the other, in the order of time.
        self.samples, last = [], 0.0
        for sensor, moment in zip(tables["sensor"], problem["moments"]):
            over = None
            if moment > last:
                phi, drive, noise = plant.over((moment - last) * problem["sample_time_s"])
                over = (phi, phi.transpose(0, 2, 1).copy(), drive, noise)
                last = moment
            h = np.zeros((len(sensor["measurement_matrix"]), n))
            h[:, :nx] = sensor["measurement_matrix"]
            self.samples.append((over, h, h.T.copy(), np.array(sensor["noise_covariance"], dtype=float)))
        self.identity = np.eye(n)
        # Channel c is active in one mode; its amplitude is read there.
        decision = tables["decision"]
        self.kappa = decision["amplitude_bound_standard_deviations"]
        active = [(m, d) for c in range(plant.f.shape[1]) for m, d in enumerate(plant.directions) if d[c].any()]
        self.active = [m for m, _ in active]
        self.amplitude = nx
        self.weight = np.empty((modes, modes))
        self.pair_means = np.empty((modes, modes, n))
        self.pair_spreads = np.empty((modes, modes, n, n))
        self.outer = np.empty((modes, modes, n, n))
        self.square = np.empty((modes, n, n))
        self.product = np.empty((modes, n, n))
        channels = 1 + (modes - 1) + len(self.active)
        self.out = np.zeros(2 * channels)
        self.out[channels : channels + modes] = decision["threshold"]
        self.channels = channels

    def inputs(self, problem):
        """The samples of every instant, a row for each sensor."""
        rows = [np.array(y).reshape(len(self.samples), -1) for y in problem["measurements"]]
        return [(y, None) for y in rows]

    def reset(self):
        self.mean = np.tile(self.mean0, (self.modes, 1))
        self.spread = np.tile(self.spread0, (self.modes, 1, 1))
        self.mu = self.mu0.copy()

    def mix(self):
        """Steps 2 to 4: returns c."""
        weight, means, spreads = self.weight, self.pair_means, self.pair_spreads
        np.multiply(self.transition, self.mu[:, None], out=weight)
        predicted = np.add.reduce(weight, axis=0)
        weight /= predicted
        if self.all_carried:
            means[:] = self.mean[:, None]
            spreads[:] = self.spread[:, None]
        else:
            np.multiply(self.mean[:, None], self.carried, out=means)
            means += self.restart_mean
            np.multiply(self.spread[:, None], self.carried_pairs, out=spreads)
            spreads += self.restart_spread
        np.matmul(weight.T[:, None], means.swapaxes(0, 1), out=self.mean[:, None])
        means -= self.mean
        np.multiply(means[..., :, None], means[..., None, :], out=self.outer)
        spreads += self.outer
        spreads *= weight[..., None, None]
        np.add.reduce(spreads, axis=0, out=self.spread)
        return predicted

    def step(self, samples, _):
        predicted = self.mix()
        mean, spread = self.mean, self.spread
        square, product = self.square, self.product
        likelihood = np.log(predicted)
        for z, (over, h, h_t, r) in zip(samples, self.samples):
            if over is not None:
                phi, phi_t, drive, noise = over
                mean[:] = np.matmul(phi, mean[..., None])[..., 0]
                mean += drive
                np.matmul(phi, spread, out=product)
                np.matmul(product, phi_t, out=spread)
                spread += noise
            innovation = z - mean @ h_t
            seen = spread @ h_t
            covariance = h @ seen
            covariance += r
            factor = np.linalg.cholesky(covariance)
            inverse = np.linalg.inv(covariance)
            gain = seen @ inverse
            mean += np.matmul(gain, innovation[..., None])[..., 0]
            np.matmul(gain, -h, out=square)
            square += self.identity
            np.matmul(square, spread, out=product)
            np.matmul(product, square.transpose(0, 2, 1), out=spread)
            spread += gain @ r @ gain.transpose(0, 2, 1)
            whitened = np.einsum("mi,mij,mj->m", innovation, inverse, innovation)
            likelihood -= 0.5 * (len(z) * LOG_TAU + whitened)
            likelihood -= np.log(factor.diagonal(axis1=1, axis2=2)).sum(axis=1)
        likelihood -= likelihood.max()
        np.exp(likelihood, out=self.mu)
        self.mu /= self.mu.sum()
        self.write()

    def write(self):
        out, channels, modes, mu = self.out, self.channels, self.modes, self.mu
        out[0] = mu[1:].sum()
        out[1:modes] = mu[1:]
        amplitude = self.mean[self.active, self.amplitude]
        deviation = np.sqrt(self.spread[self.active, self.amplitude, self.amplitude])
        out[modes:channels] = amplitude
        out[channels + modes :] = amplitude + self.kappa * deviation


LOG_TAU = np.log(2 * np.pi)

if __name__ == "__main__":
    run(Estimator)
