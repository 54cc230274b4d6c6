"""Problems that were not used for the choice of the default: they were added after the rule.

The formulas are given as in `benchmarks.problems`; the scenes are made from them by `jaxdyn.ode`.
"""

from benchmarks.classics import ode_of
from benchmarks.problems import Problem


def chen() -> Problem:
    """The system of Chen and Ueta."""

    def formulas(lib):
        def rate(y):
            return [35 * (y[1] - y[0]), (28 - 35 - y[2]) * y[0] + 28 * y[1], y[0] * y[1] - 3 * y[2]]

        return rate

    return ode_of(formulas, [-3.0, 2.0, 20.0], 3.0)


def hindmarsh_rose() -> Problem:
    """Bursts of a neuron."""

    def formulas(lib):
        def rate(s):
            x, y, z = s[0], s[1], s[2]
            fast = y - x * x * x + 3 * x * x - z + 3.25
            return [fast, 1 - 5 * x * x - y, 0.005 * (4 * (x + 1.6) - z)]

        return rate

    return ode_of(formulas, [-1.3, -7.0, 3.0], 200.0)


def foucault() -> Problem:
    """Foucault's pendulum, small swings: a linear problem."""

    def formulas(lib):
        def rate(s):
            return [s[2], s[3], -s[0] + 0.1 * s[3], -s[1] - 0.1 * s[2]]

        return rate

    return ode_of(formulas, [1.0, 0.0, 0.0, 0.0], 100.0)


def hill() -> Problem:
    """Hill's lunar problem, a satellite that stays for some turns."""

    def formulas(lib):
        def rate(s):
            x, y, u, v = s[0], s[1], s[2], s[3]
            r2 = x * x + y * y
            pull = 1 / (r2 * lib.sqrt(r2))
            return [u, v, 2 * v + 3 * x - pull * x, -2 * u - pull * y]

        return rate

    return ode_of(formulas, [0.3, 0.0, 0.0, 1.6], 10.0)


def parametric() -> Problem:
    """A pendulum whose pivot shakes upwards and downwards, with friction."""

    def formulas(lib):
        def rate(s):
            # The phase of the forcing is a state variable, since heyoka's formulas have no time.
            lift = 1 + 2.5 * lib.cos(s[2])
            return [s[1], -0.2 * s[1] - lift * lib.sin(s[0]), 2.0 + 0.0 * s[2]]

        return rate

    return ode_of(formulas, [0.4, 0.0, 0.0], 50.0)


def food_chain() -> Problem:
    """Plants, their eaters, and the eaters of those, with saturated appetites."""

    def formulas(lib):
        def rate(s):
            x, y, z = s[0], s[1], s[2]
            first, second = 5 * x * y / (1 + 3 * x), 0.1 * y * z / (1 + 2 * y)
            return [x * (1 - x) - first, first - second - 0.4 * y, second - 0.01 * z]

        return rate

    return ode_of(formulas, [0.8, 0.2, 9.0], 200.0)


def kuramoto() -> Problem:
    """Four coupled oscillators of different frequencies."""
    n = 4

    def formulas(lib):
        def rate(s):
            rates = []
            for i in range(n):
                pull = 1.0 + 0.3 * i
                for j in range(n):
                    if j != i:
                        pull = pull + 0.2 * lib.sin(s[j] - s[i])
                rates.append(pull)
            return rates

        return rate

    return ode_of(formulas, [0.0, 1.0, 2.0, 4.0], 50.0)


def stoermer() -> Problem:
    """A charged particle in the field of a dipole, in its meridian plane."""

    def formulas(lib):
        def rate(s):
            rho, z, u, v = s[0], s[1], s[2], s[3]
            r2 = rho * rho + z * z
            cube = r2 * lib.sqrt(r2)
            turn = 1 / rho - rho / cube
            slope = -1 / (rho * rho) - 1 / cube + 3 * rho * rho / (cube * r2)
            return [u, v, -turn * slope, -turn * 3 * rho * z / (cube * r2)]

        return rate

    return ode_of(formulas, [0.9, 0.0, 0.02, 0.08], 100.0, second_order=True)


def galaxy() -> Problem:
    """A star in a logarithmic potential with three different axes."""

    def formulas(lib):
        def rate(s):
            x, y, z = s[0], s[1], s[2]
            pull = 1 / (0.01 + x * x + y * y / 0.81 + z * z / 0.49)
            return [s[3], s[4], s[5], -pull * x, -pull * y / 0.81, -pull * z / 0.49]

        return rate

    return ode_of(formulas, [0.5, 0.0, 0.2, 0.0, 0.7, 0.0], 50.0, second_order=True)


def fermi() -> Problem:
    """The chain of Fermi, Pasta, Ulam and Tsingou with six points and quadratic forces."""
    n = 6

    def formulas(lib):
        def rate(s):
            zero = 0.0 * s[0]
            q = [zero, *(s[i] for i in range(n)), zero]
            d = [q[i + 1] - q[i] for i in range(n + 1)]
            f = [x + 0.25 * x * x for x in d]
            return [s[n + i] for i in range(n)] + [f[i + 1] - f[i] for i in range(n)]

        return rate

    start = [0.43, 0.78, 0.97, 0.97, 0.78, 0.43]
    return ode_of(formulas, [*start, *(0.0 for _ in start)], 100.0, second_order=True)


def hoop() -> Problem:
    """A bead on a turning hoop, with friction."""

    def formulas(lib):
        def rate(s):
            return [s[1], (2.0 * lib.cos(s[0]) - 1.0) * lib.sin(s[0]) - 0.02 * s[1]]

        return rate

    return ode_of(formulas, [0.1, 0.0], 100.0)


def spinning() -> Problem:
    """The heavy symmetric top in Euler's angles."""

    def formulas(lib):
        def rate(s):
            a, u = s[0], s[2]
            sine, cosine = lib.sin(a), lib.cos(a)
            # Conserved: the spin along the axis, 3, and the turn about the vertical, 2.5.
            turn = (2.5 - 3.0 * cosine) / (sine * sine)
            return [u, turn, turn * sine * (turn * cosine - 3.0) + sine]

        return rate

    return ode_of(formulas, [0.6, 0.0, 0.0], 100.0)


OTHERS = {
    "Chen": chen,
    "Hindmarsh-Rose": hindmarsh_rose,
    "Foucault": foucault,
    "Hill": hill,
    "shaken pendulum": parametric,
    "food chain": food_chain,
    "Kuramoto": kuramoto,
    "Stoermer": stoermer,
    "triaxial galaxy": galaxy,
    "chain of springs": fermi,
    "bead on a hoop": hoop,
    "symmetric top": spinning,
}
