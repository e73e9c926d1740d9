"""A harmonic balance of its own, in numpy, of elastic pairs with one tangential direction whose
residual traction is given: displacements from instant to instant, exact derivatives, and a walk
from one set of shares to another."""
from __future__ import annotations

import numpy as np
from scipy.optimize import root


def march(y, q):
    """Coulomb's law from instant to instant, of a second turn (which repeats, as turns of one
    direction do): nan where it slips or is open, else 0; the last instant that moved x (-1: none),
    and the direction of slip there, 0 where it opened."""
    x, since, pull = 0.0, -1, 0.0
    state, origin, side = np.zeros(len(y)), np.full(len(y), -1), np.zeros(len(y))
    for turn in range(2):
        for k, (now, limit) in enumerate(zip(y, q)):
            if limit < 0.0:
                x, since, pull, slips = now, k, 0.0, True
            elif abs(now - x) > limit:
                pull = 1.0 if now > x else -1.0
                x, since, slips = now - pull * limit, k, True
            else:
                slips = False
            if turn == 1:
                state[k], origin[k], side[k] = np.nan if slips else 0.0, since, pull
    return state, origin, side


class Balance:
    """K, C, M (n, n), rows of the pairs along t and n (n_pairs, n), their constants (n_pairs),
    loads (2H+1, n) and instants. `wrong` leaves dP out of z: a variant that tests are to notice."""

    def __init__(self, M, C, K, along, across, mu, kt, kn, load, instants, gap=0.0, wrong=False):
        self.M, self.C, self.K = (np.asarray(a, float) for a in (M, C, K))
        self.along, self.across = np.asarray(along, float), np.asarray(across, float)
        self.mu, self.kt, self.kn = (np.asarray(a, float) for a in (mu, kt, kn))
        self.load, self.gap, self.wrong = np.asarray(load, float), gap, wrong
        H = (len(self.load) - 1) // 2
        tau = 2.0 * np.pi * np.arange(instants) / instants
        n = np.arange(1, H + 1)
        E = np.ones((instants, 2 * H + 1))
        E[:, 1::2], E[:, 2::2] = np.cos(np.outer(tau, n)), np.sin(np.outer(tau, n))
        self.E, self.harmonics = E, H
        self.A = E.T * (2.0 / instants)
        self.A[0] *= 0.5

    def stiffness(self, omega):
        """Z of the stacked coefficients, coefficient by coefficient."""
        n, nc = len(self.K), 2 * self.harmonics + 1
        Z = np.zeros((nc, n, nc, n))
        Z[0, :, 0] = self.K
        for h in range(1, self.harmonics + 1):
            s, c, d = h * omega, 2 * h - 1, 2 * h
            Z[c, :, c] = Z[d, :, d] = self.K - s**2 * self.M
            # U = c - i s: i s C U has the cosine part s C s, and the sine part -s C c.
            Z[c, :, d], Z[d, :, c] = s * self.C, -s * self.C
        return Z.reshape(nc * n, nc * n)

    def force(self, i, y_t, y_n, share):
        """Tangential force of pair i at the instants and its rows by the coefficients of y_t and of
        y_n; half of the distance between the ends of z, 0 where the march says it."""
        E, mu = self.E, self.mu[i]
        q = -mu * y_n
        a, b = np.argmax(y_t - q), np.argmin(y_t + q)
        low, high = (y_t - q)[a], (y_t + q)[b]
        if low < high:
            left, right = 0.5 * (1.0 - share), 0.5 * (1.0 + share)
            z_t = 0.0 if self.wrong else left * E[a] + right * E[b]
            z_n = mu * (left * E[a] - right * E[b])
            rows_t, rows_n = E - z_t, -np.ones((len(E), 1)) * z_n
            return y_t - (left * low + right * high), rows_t, rows_n, 0.5 * (high - low)
        T, since, pull = march(y_t.tolist(), q.tolist())
        stands = since >= 0
        at, slips = np.where(stands, since, 0), np.isnan(T)
        # Behind the last motion x stands: at y_t - pull q, or at y_t where it opened.
        x = y_t[at] - pull * q[at]
        T = np.where(slips, pull * np.maximum(q, 0.0), y_t - np.where(stands, x, 0.0))
        by_t = np.where(slips[:, None], 0.0, E - np.where(stands[:, None], E[at], 0.0))
        by_n = -(mu * pull)[:, None] * np.where(slips[:, None], E, E[at])
        return T, by_t, by_n, 0.0

    def residual(self, u, Z, shares, alone=False):
        """Residual (`alone`: nothing else), its derivative, dR by the shares, and which pairs a
        traction holds."""
        nc, n = u.shape
        R = Z @ u.ravel() - self.load.ravel()
        J = None if alone else Z.copy().reshape(nc, n, nc, n)
        by_share = np.zeros((nc, n, len(shares)))
        held = np.zeros(len(shares), bool)
        R = R.reshape(nc, n)
        for i, share in enumerate(shares):
            d, e = self.along[i], self.across[i]
            y_t = self.kt[i] * (self.E @ (u @ d))
            y_n = self.kn[i] * (self.E @ (u @ e) + self.gap)
            T, by_t, by_n, reach = self.force(i, y_t, y_n, share)
            bears = y_n < 0.0
            R += np.outer(self.A @ T, d) + np.outer(self.A @ np.where(bears, y_n, 0.0), e)
            if alone:
                continue
            G_t, G_n = self.kt[i] * (self.A @ by_t), self.kn[i] * (self.A @ by_n)
            N = self.kn[i] * (self.A * bears) @ self.E
            J += np.einsum("p,aq,r->apqr", d, G_t, d) + np.einsum("p,aq,r->apqr", d, G_n, e)
            J += np.einsum("p,aq,r->apqr", e, N, e)
            by_share[0, :, i] = -reach * d
            held[i] = reach > 0.0
        if alone:
            return R.ravel()
        return R.ravel(), J.reshape(nc * n, nc * n), by_share.reshape(nc * n, -1), held

    def solve(self, omega, shares, u=None, tolerance=1e-12):
        """Newton's method from a guess; the solution, or None."""
        Z = self.stiffness(omega)
        u = np.zeros_like(self.load) if u is None else u.copy()
        scale = np.abs(self.load).max()
        for _ in range(25):
            R, J, _, _ = self.residual(u, Z, shares)
            size = np.abs(R).max()
            if size <= tolerance * scale:
                return u
            try:
                step = np.linalg.solve(J, -R).reshape(u.shape)
            except np.linalg.LinAlgError:
                return None
            for k in range(6):
                trial = u + 0.5**k * step
                if np.abs(self.residual(trial, Z, shares, alone=True)).max() < size:
                    break
            else:
                return None
            u = trial
        return None

    def walk(self, omega, start, u, shares):
        """From a solution at some shares to one at others, in steps that are halved where one
        fails; None where that ends."""
        at, step = 0.0, 1.0
        while at < 1.0:
            to = min(1.0, at + step)
            found = self.solve(omega, start + to * (shares - start), u)
            if found is not None:
                u, at = found, to
                continue
            step *= 0.5
            if step < 1.0 / 16.0:
                return None
        return u

    def solve_anyhow(self, omega, shares, u, tolerance=1e-12):
        """Newton's method, or Powell's hybrid one where it turns between two sides of a kink."""
        found = self.solve(omega, shares, u, tolerance)
        if found is not None:
            return found
        Z, scale = self.stiffness(omega), np.abs(self.load).max()

        def both(x):
            R, J, _, _ = self.residual(x.reshape(u.shape), Z, shares)
            return R / scale, J / scale

        there = root(both, u.ravel(), jac=True, options={"maxfev": 400, "xtol": 1e-15})
        found = there.x.reshape(u.shape)
        near = np.abs(there.fun).max() <= 1e-9
        return self.solve(omega, shares, found, 1e-9) if near else None

    def follow(self, omega, u, shares, part=0.03):
        """From the central solution straight to shares, in steps that change the vibration by that
        part of it at most; None where a fold or a jump ends the way."""
        size, at, step = np.linalg.norm(u[1:]), 0.0, 0.125
        while at < 1.0:
            to = min(1.0, at + step)
            found = self.solve_anyhow(omega, to * shares, u)
            if found is not None and np.linalg.norm(found[1:] - u[1:]) <= part * size:
                u, at, step = found, to, min(2.0 * step, 0.125)
                continue
            step *= 0.5
            if step < 2.0**-20:
                return None
        return u

    def slope(self, omega, shares, u):
        """du by the shares (2H+1, n, n_pairs)."""
        _, J, by_share, held = self.residual(u, self.stiffness(omega), shares)
        return np.linalg.solve(J, -by_share).reshape(*u.shape, -1), held


def of_groups(groups, instants=None, wrong=False):
    """The balance of a namelist whose pairs have rows or dofs for sides."""
    model, contact, load = groups["model"], groups["contact"], groups["load"]
    n = model["n_dof"]
    M, C, K = (np.reshape(model.get(key, np.zeros(n * n)), (n, n)).T
               for key in ("mass", "damping", "stiffness"))
    rows = np.eye(n)
    if "row" in model:
        rows = np.vstack([rows, np.reshape(model["row"], (-1, n))])
    rows = np.vstack([np.zeros(n), rows])

    def side(component):
        def at(key):
            numbers = np.reshape(contact[key], (-1, 3))[:, component]
            return np.sign(numbers)[:, None] * rows[np.abs(numbers)]
        return at("side_1") - at("side_2")

    pairs = contact["n_pairs"]
    mu, kt, kn = (np.broadcast_to(contact[key], pairs) for key in
                  ("mu", "tangential_stiffness", "normal_stiffness"))
    forces = np.zeros((2 * groups["harmonics"]["n_harmonics"] + 1, n))
    for k, key in enumerate(("static", "cosine", "sine")):
        forces[k] = load.get(key, 0.0)
    return Balance(M, C, K, side(0), side(2), mu, kt, kn, forces,
                   instants or groups["harmonics"]["n_time"], wrong=wrong)
