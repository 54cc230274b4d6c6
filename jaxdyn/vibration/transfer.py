"""Transfer functions of a scene about an equilibrium, and its frequency responses.

Near an equilibrium y = y* + x, with an input u and an output z,

    dx/dt = A x + B0 u + B1 du/dt,   z = C x,   H(s) = C (s - A)^-1 (B0 + s B1),

where all matrices are exact derivatives of the rate and the output. At s = i omega, H is the ratio
of the complex amplitudes of z and u in a forced vibration with e^(i omega t).
"""

import dataclasses
import re
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from jaxdyn import _checks, _text
from jaxdyn._checks import check_first
from jaxdyn._labelled import Labelled, Values, frame
from jaxdyn._records import Record
from jaxdyn.analysis.linearize import check_equilibrium, jacobian
from jaxdyn.scene import Scene, check_scene
from jaxdyn.vibration.inputs import Base, Input, Output, check_input, named_output, output


class TransferFunction(Record):
    """H(s) from an input to an output, a function of complex numbers s (...).

    At an angular frequency omega call ``h(1j * omega)``, which is ``h.at(omega)``. A real number is
    taken as s itself: ``h(0.0)`` is the response to a constant input, ``h(30.0)`` that to one which
    grows as e^(30 t).

    `drawing.bode` and `to_pandas` show it with the names and units of both.

    A batch of them, made by `jax.vmap`, is a function whose values have the batch axes in front.

    Attributes:
      a: (k, k) A.
      b: (k, j) B0 and B1.
      c: (..., k) C.
      input: what the input is called, and its unit, "" if not known.
      output: likewise the output.
      time: the unit of time; "" without one.
      order: number of time derivatives of the output: 1 for its velocity, 2 for its acceleration.
    """

    a: Array
    b: Array
    c: Array
    input: tuple[str, str] = eqx.field(static=True, default=("input", ""))
    output: tuple[str, str] = eqx.field(static=True, default=("output", ""))
    time: str = eqx.field(static=True, default="")
    order: int = eqx.field(static=True, default=0)

    @_text.never_raising
    def __repr__(self) -> str:
        of, on = (_text.with_unit(*both) for both in (self.output, self.input))
        poles = _text.brief(self.poles, f"1/{self.time}" if self.time else "")
        rows = [("input", on), ("output", of), ("unit", self.unit), ("poles", poles)]
        return _text.table(f"Transfer function {self.name}", rows)

    _repr_html_ = _text.html

    def __call__(self, s) -> Array:
        """(..., *outputs) complex H at s (...) [1/s]: 1j * omega at an angular frequency."""
        if self.a.ndim > 2:
            return jax.vmap(lambda one: one(s))(self)
        s = jnp.asarray(s).astype(complex)
        return jnp.vectorize(self._at, signature=_signature(self.c))(s)

    def at(self, omega) -> Array:
        """(..., *outputs) complex H at angular frequencies omega (...) [rad/s]."""
        return self(_imaginary(omega))

    def derivative(self, order: int = 1) -> "TransferFunction":
        """The transfer function to a time derivative of the output: s^order H."""
        return dataclasses.replace(self, order=self.order + _checks.whole("order", order))

    @property
    def name(self) -> str:
        """The output over the input, by name, such as "x / force on x"."""
        (of, _), (on, _) = self.output, self.input
        return f"{_RATES.get(self.order, f'derivative {self.order} of ')}{of} / {on}"

    @property
    def unit(self) -> str:
        """The unit of its values, such as "m/N"; "" where it is not known."""
        (_, of), (_, on) = self.output, self.input
        if not (of and on and (self.time or not self.order)):
            return ""
        power = f"^{self.order}" if self.order > 1 else ""
        of = f"{_grouped(of)}/{self.time}{power}" if self.order else of
        return f"{_grouped(of)}/{_grouped(on)}"

    def table(self, omega, *, hertz: bool = False) -> Labelled:
        """The magnitudes and phases at angular frequencies, with their names; see `to_pandas`."""
        omega = np.asarray(_checks.array("omega", omega, (None,)))
        values = np.asarray(self.at(omega)).reshape(len(omega), -1)
        numbers = [""] if values.shape[1] == 1 else [f" {i}" for i in range(values.shape[1])]
        scale, unit = _text.frequency_scale(self.time, hertz=hertz)
        axis = "frequency" if hertz else "omega"
        axes, found = (axis,), {}
        for i, number in enumerate(numbers):
            found[self.name + number] = Values(axes, np.abs(values[:, i]), self.unit)
            found[f"phase{number}"] = Values(axes, np.angle(values[:, i]), "rad")
        return Labelled({axis: Values(axes, scale * omega, unit)}, found)

    def to_pandas(self, omega, *, hertz: bool = False) -> Any:
        """The magnitudes and phases [rad] at angular frequencies as a pandas DataFrame.

        ``frame.attrs["units"]`` has all units; a `drawing.bode` plot has the phases in degrees.

        Args:
          omega: (s,) angular frequencies [rad/s].
          hertz: whether the index has the frequencies in Hz, or in turns per unit of time.
        Raises:
          ValueError: pandas is not installed.
        """
        return frame(self.table(omega, hertz=hertz))

    @property
    def poles(self) -> Array:
        """(k,) complex eigenvalues of A [1/s]."""
        return jnp.linalg.eigvals(self.a)

    def _at(self, s: Array) -> Array:
        a, b, c = (x.astype(complex) for x in (self.a, self.b, self.c))
        powers = jnp.stack([s**j for j in range(b.shape[1])])
        found = c @ _solve(s * jnp.eye(len(a), dtype=complex) - a, b @ powers)
        return s**self.order * found if self.order else found  # which may be infinite


#: What goes in front of the name of an output, by the number of its time derivatives.
_RATES = {0: "", 1: "velocity of ", 2: "acceleration of "}


def _grouped(unit: str) -> str:
    """A unit that stands in a quotient: in brackets, if it is not a single one."""
    return f"({unit})" if re.search(r"[ /]", unit) else unit


def _solve(matrix: Array, right: Array) -> Array:
    """(k,) the solution of linear equations, also where entries have different units.

    At kHz a velocity in m/s is thousands of times the position in m, and elimination loses as much.
    One step of iterative refinement restores it (Skeel 1980, Math. Comp. 35, 817).
    """
    found = jnp.linalg.solve(matrix, right)
    return found + jnp.linalg.solve(matrix, right - matrix @ found)


def _signature(c: Array) -> str:
    return "()->()" if c.ndim == 1 else f"()->({c.shape[0]})"


@check_first
def transfer_function(
    scene: Scene, input: str | Input, to: Output, y=None, t=0.0
) -> TransferFunction:
    """The transfer function h of a scene about an equilibrium, from an input to an output.

    Call ``h(1j * omega)``, or ``h.at(omega)``, for its value at an angular frequency: its argument
    is s.

    Args:
      scene: any scene.
      input: where it acts: the name of a coordinate for a force on it (in a plain `ode`, whose
        masses are not known, a force per mass), or `vibration.Force`, `Base`, `Motion` or
        `Parameter`.
      to: the output: the name of an entry of the state, or a function (t, y) that returns () or
        (m,).
      y: (k,) an equilibrium; the scene's start by default.
      t: () time [s] at which a time-dependent scene is evaluated.
    Raises:
      ValueError: y is not an equilibrium, the input does not suit the scene, or there is no such
        output.
    Limits: differentiable with respect to all numbers, also under jit and vmap.
    Example:
      >>> from jaxdyn import scenes, vibration
      >>> h = vibration.transfer_function(scenes.oscillator(k=4.0, x=0.0), "x", "x")
      >>> round(h(1j).real.item(), 12)  # 1 / (k - omega^2) at omega = 1, as h.at(1.0)
      0.333333333333
      >>> round(h(1.0).real.item(), 12)  # 1 / (k + s^2) at s = 1, which is no frequency
      0.2
    """
    check_scene(scene)
    found = check_input(scene, input)
    y = _checks.array("y", scene.y0 if y is None else y, scene.y0.shape)
    t = _checks.array("t", t, ())
    measured = output("to", to, scene)
    if not _checks.is_traced((scene, y, t)):
        check_equilibrium(scene, y, t)

    def rate(u):
        return found.rate(scene.field, t, y, u)

    b = jax.jacfwd(rate)(jnp.zeros(found.order + 1))
    c = jax.jacfwd(lambda y: measured(t, y))(y)
    return TransferFunction(
        jacobian(scene, y, t),
        b,
        c,
        input=found.named(scene),
        output=named_output(to, scene),
        time=_text.second(scene.labels()),
    )


@check_first
def receptance(scene: Scene, input: str | Input, to: Output, omega, y=None) -> Array:
    """Displacement over force: complex amplitude of an output, per unit of an input.

    Args:
      scene: any scene.
      input: see `transfer_function`; a name is a force on that coordinate, or a force per mass in
        a plain `ode`.
      to: see `transfer_function`.
      omega: (...) angular frequencies [rad/s].
      y: (k,) an equilibrium; the scene's start by default.
    Returns:
      (..., *outputs) complex; ``abs`` is the magnitude, and minus ``angle`` the phase lag.
    """
    return transfer_function(scene, input, to, y).at(omega)


@check_first
def mobility(scene: Scene, input: str | Input, to: Output, omega, y=None) -> Array:
    """Velocity over force: i omega times the `receptance`, with the same arguments."""
    return transfer_function(scene, input, to, y).derivative(1).at(omega)


@check_first
def accelerance(scene: Scene, input: str | Input, to: Output, omega, y=None) -> Array:
    """Acceleration over force: -omega^2 times the `receptance`, with the same arguments."""
    return transfer_function(scene, input, to, y).derivative(2).at(omega)


@check_first
def transmissibility(scene: Scene, direction, omega, *, point: int = 0, y=None) -> Array:
    """Displacement of a material point over that of the base on which the scene stands.

    Both are absolute displacements along the direction. Everything attached to the base moves with
    it: anchors, pins, dashpots to the ground.

    Args:
      scene: a scene with material points, whose positions are relative to the base.
      direction: (d,) direction of the motion of the base.
      omega: (...) angular frequencies [rad/s].
      point: number of the material point.
      y: (k,) an equilibrium; the scene's start by default.
    Returns:
      (...) complex.
    Raises:
      ValueError: there is no such point, or see `transfer_function`.
    Example:
      >>> from jaxdyn import scenes, vibration
      >>> found = vibration.transmissibility(scenes.oscillator(k=4.0, x=0.0), [1.0], 4.0)
      >>> round(float(abs(found)), 12)  # k / (omega^2 - k)
      0.333333333333
    """
    along = _checks.array("direction", direction, (None,))
    if not _checks.is_traced(along) and not np.any(np.asarray(along)):
        raise _checks.fail("direction", "one along which the base moves", "one of length 0")
    along = along / jnp.linalg.norm(along)
    check_input(scene, Base(along))
    _checks.whole("point", point, 0, len(scene.points(jnp.zeros(()), scene.y0).m) - 1)

    def place(t, y):
        return scene.points(t, y).r[point] @ along

    relative = transfer_function(scene, Base(along), place, y).at(omega)
    return 1.0 + _imaginary(omega) ** 2 * relative


def _imaginary(omega) -> Array:
    omega = _checks.numbers("omega", omega)
    return jax.lax.complex(jnp.zeros_like(omega), omega)
