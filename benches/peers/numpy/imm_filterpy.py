"""filterpy's IMMEstimator on the synchronous case: all rows at the sampling instant, amplitudes mixed between all modes."""

import filterpy
import numpy as np
from filterpy.kalman import IMMEstimator, KalmanFilter
from imm_model import Plant
from peer import run


class Estimator:
    def __init__(self, problem):
        tables = problem["tables"]
        plant = Plant(tables)
        self.mean, self.spread = plant.prior(tables)
        self.phi, self.drive, self.noise = plant.over(problem["sample_time_s"])
        sensors = tables["sensor"]
        rows = [len(sensor["measurement_matrix"]) for sensor in sensors]
        self.h = np.zeros((sum(rows), len(self.mean)))
        self.h[:, : plant.nx] = np.vstack([sensor["measurement_matrix"] for sensor in sensors])
        self.r = np.zeros((sum(rows),) * 2)
        for place, sensor, count in zip(np.cumsum([0, *rows]), sensors, rows):
            self.r[place : place + count, place : place + count] = sensor["noise_covariance"]
        self.mu = np.array(tables["initial"]["mode_probability"], dtype=float)
        self.transition = np.array(tables["transition"]["matrix"], dtype=float)
        self.kappa = tables["decision"]["amplitude_bound_standard_deviations"]
        self.threshold = tables["decision"]["threshold"]
        directions = plant.directions
        self.active = [m for c in range(plant.f.shape[1]) for m, d in enumerate(directions) if d[c].any()]
        self.amplitude = plant.nx
        self.command = np.array([[1.0]])

    def inputs(self, problem):
        return [(np.array(y)[:, None], None) for y in problem["measurements"]]

    def reset(self):
        filters = []
        for phi in self.phi:
            kalman = KalmanFilter(dim_x=len(self.mean), dim_z=len(self.h), dim_u=1)
            kalman.x, kalman.P = self.mean[:, None].copy(), self.spread.copy()
            kalman.F, kalman.B, kalman.Q = phi, self.drive[:, None], self.noise
            kalman.H, kalman.R = self.h, self.r
            filters.append(kalman)
        self.estimator = IMMEstimator(filters, self.mu, self.transition)

    def step(self, z, _):
        self.estimator.predict(self.command)
        self.estimator.update(z)

    @property
    def out(self):
        """Read from the estimator where the numbers are compared, not in every timed step."""
        mu = self.estimator.mu
        kalman = [self.estimator.filters[m] for m in self.active]
        amplitude = np.array([one.x[self.amplitude, 0] for one in kalman])
        deviation = np.sqrt([one.P[self.amplitude, self.amplitude] for one in kalman])
        bounds = [self.threshold] * len(mu)
        return np.concatenate([[mu[1:].sum()], mu[1:], amplitude, bounds, amplitude + self.kappa * deviation])


if __name__ == "__main__":
    run(Estimator, f"filterpy {filterpy.__version__} with numpy {np.__version__}")
