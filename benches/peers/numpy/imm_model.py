"""What both peers of the multiple-model estimator compute off-line: the plant over an interval, exactly."""

import numpy as np


def exponential(matrix):
    """e^matrix by scaling and squaring."""
    norm = np.abs(matrix).sum(axis=0).max()
    squarings = max(0, int(np.ceil(np.log2(norm / 0.25)))) if norm > 0 else 0
    scaled = matrix / 2.0**squarings
    result = term = np.eye(len(matrix))
    for k in range(1, 18):
        term = term @ scaled / k
        result = result + term
    for _ in range(squarings):
        result = result @ result
    return result


class Plant:
    """dx/dt = A x + B u + G w + F f with f = D_m phi; x and phi are one state."""

    def __init__(self, tables):
        plant = tables["plant"]
        self.a, self.b, self.g, self.f = (np.array(plant[name], dtype=float) for name in "ABGF")
        self.q = self.g @ np.array(plant["process_noise_psd"], dtype=float) @ self.g.T
        self.u = np.array(tables["input"]["constant"], dtype=float)
        self.directions = [np.array(mode["direction"], dtype=float) for mode in tables["mode"]]
        self.nx, self.slots = len(self.a), self.directions[0].shape[1]

    def over(self, seconds):
        """Phi, its input and its noise of [x; phi] for every mode, over so many seconds."""
        nx, nu, nf = self.nx, self.b.shape[1], self.f.shape[1]
        n = nx + self.slots
        block = np.zeros((nx + nu + nf,) * 2)
        block[:nx] = np.hstack([self.a, self.b, self.f]) * seconds
        moved = exponential(block)
        phi, inputs, faults = moved[:nx, :nx], moved[:nx, nx : nx + nu], moved[:nx, nx + nu :]
        loan = np.block([[-self.a, self.q], [np.zeros((nx, nx)), self.a.T]]) * seconds
        loan = exponential(loan)
        noise = loan[nx:, nx:].T @ loan[:nx, nx:]
        modes = np.zeros((len(self.directions), n, n))
        for mode, direction in zip(modes, self.directions):
            mode[:] = np.eye(n)
            mode[:nx, :nx] = phi
            mode[:nx, nx:] = faults @ direction
        drive = np.concatenate([inputs @ self.u, np.zeros(self.slots)])
        spread = np.zeros((n, n))
        spread[:nx, :nx] = (noise + noise.T) / 2
        return modes, drive, spread

    def prior(self, tables):
        """Mean and covariance of [x; phi] at the start."""
        initial, amplitude = tables["initial"], tables["amplitude"]
        mean = np.concatenate([initial["state"], amplitude.get("prior_mean") or np.zeros(self.slots)])
        spread = np.zeros((len(mean),) * 2)
        spread[: self.nx, : self.nx] = initial["state_covariance"]
        spread[self.nx :, self.nx :] = np.diag(np.square(amplitude["prior_standard_deviation"]))
        return mean, spread
