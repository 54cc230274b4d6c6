"""Training by gradient descent: against least squares, and what it refuses."""

import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from helpers import gap

import jaxdyn
from jaxdyn import scenes
from jaxdyn.fitting import TrainingStatus

TS = np.linspace(0.0, 2.0, 21)


def decay(t, y, p):
    del t
    return [-p["k"] * y[0]]


def decaying(k):
    return jaxdyn.ode(decay, [1.0], names=["x"], params={"k": k})


def train(data, guess=None, make=decaying, **options):
    guess = {"k": 1.0} if guess is None else guess
    return jaxdyn.train(make, guess, data, **options)


def refusal(call):
    with pytest.raises(ValueError, match=":") as caught:
        call()
    return str(caught.value)


@pytest.fixture(scope="module")
def noisy():
    return {"t": TS, "x": np.exp(-0.7 * TS) + 0.01 * np.random.default_rng(0).standard_normal(21)}


@pytest.fixture(scope="module")
def found(noisy):
    return train(noisy, steps=600)


@pytest.mark.slow
def test_the_best_parameters_are_those_of_least_squares_one_step_ahead(noisy, found):
    x = noisy["x"]
    factor = x[:-1] @ x[1:] / (x[:-1] @ x[:-1])  # of the linear map from one row to the next
    assert abs(found.params["k"] + np.log(factor) / TS[1]) < 1e-4
    off = x[:-1] * np.exp(-1.0 * TS[1]) - x[1:]
    assert abs(found.losses[0] - np.mean(off**2) / np.std(x) ** 2) < 1e-6 * found.losses[0]
    assert found.losses.shape == (601,)
    assert found.ok
    assert found.outcome == TrainingStatus.DONE
    assert gap(found.scene.y0, x[:1]) == 0
    assert "Training of decay" in repr(found)
    assert "600" in repr(found)


@pytest.mark.slow
def test_gaps_are_left_out_and_longer_spans_predict_further(noisy):
    data = {"t": TS, "x": noisy["x"].copy()}
    data["x"][7] = np.nan
    found = train(data, steps=600, ahead=2)
    k = np.linspace(0.5, 1.0, 2001)
    t, x = (np.delete(column, 7) for column in (data["t"], data["x"]))
    pairs = [(i, i + n) for i in range(len(x) - 2) for n in (1, 2)]
    off = [x[i] * np.exp(-k * (t[j] - t[i])) - x[j] for i, j in pairs]
    loss = np.mean(np.square(off), axis=0) / np.var(x)
    assert abs(found.params["k"] - k[loss.argmin()]) < 2 * (k[1] - k[0])
    assert abs(np.nanmin(found.losses) - loss.min()) < 1e-5 * loss.min()


@pytest.mark.slow
def test_a_network_learns_a_force():
    def rate(t, y, p):
        del t
        return {"x": y["v"], "v": p["net"](y["x"][None])[0] - p["damping"] * y["v"]}

    def scene(p):
        return jaxdyn.ode(rate, {"x": 1.5, "v": 0.0}, 10.0, params=p)

    def truth(t, y):
        del t
        return {"x": y["v"], "v": -y["x"] - y["x"] ** 3 - 0.2 * y["v"]}

    seen = jaxdyn.simulate(jaxdyn.ode(truth, {"x": 1.5, "v": 0.0}, 10.0), samples=41)
    net = eqx.nn.MLP(1, 1, 8, 1, jnp.tanh, key=jax.random.key(0))
    guess = {"net": net, "damping": jnp.asarray(0.5)}
    found = jaxdyn.train(scene, guess, seen, steps=300, optimiser=optax.adam(0.03))
    assert abs(found.params["damping"] - 0.2) < 0.01
    x = jnp.linspace(-1.2, 1.2, 7)[:, None]
    assert jnp.max(jnp.abs(jax.vmap(found.params["net"])(x) + x + x**3)) < 0.1


@pytest.mark.slow
def test_the_units_of_a_number_do_not_matter(noisy):
    """The rate in 1/s and in 1/h; the same steps up to rounding."""
    hourly = train(noisy, {"k": 3600.0}, lambda k: decaying(k / 3600), steps=50)
    plain = train(noisy, {"k": 1.0}, steps=50)
    np.testing.assert_allclose(hourly.params["k"] / 3600, plain.params["k"], rtol=1e-10)
    assert abs(plain.params["k"] - 1) > 0.2
    np.testing.assert_allclose(hourly.losses, plain.losses, rtol=1e-9)
    from_zero = train(noisy, {"k": 0.0}, steps=50)  # in its own unit
    assert from_zero.params["k"] > 0.3


def test_a_loss_that_is_lost_leaves_the_best_parameters(noisy):
    found = train(noisy, steps=20, optimiser=optax.sgd(1e6))
    assert found.outcome == TrainingStatus.NO_MOTION
    assert not found.ok
    assert "smaller learning rate" in found.message
    assert np.isfinite(found.params["k"])
    assert np.isnan(found.losses[-1])
    assert np.nanmin(found.losses) <= found.losses[0]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"steps": 0}, "steps: expected"),
        ({"ahead": 0}, "ahead: expected"),
        ({"ahead": 30}, "a complete row with 30 more after it, got 21 rows without one"),
        ({"optimiser": 0.01}, "optimiser: expected one of Optax, got float"),
        ({"guess": {"kk": 1.0}}, "guess: expected"),
    ],
)
def test_misuse_is_refused(noisy, options, said):
    assert said in refusal(lambda: train(noisy, **options))


def test_every_entry_of_the_state_is_measured():
    data = {"t": TS, "theta": np.sin(TS)}
    said = refusal(lambda: jaxdyn.train(scenes.pendulum, {"g": 9.0}, data))
    assert re.search("each entry of the state, got none for theta_dot.*jaxdyn.fit", said)


def _decay(k):
    return jaxdyn.ode(lambda t, y, k: [-k * y[0]], [1.0], 1.0, names=["x"], params=k)


def test_the_parameters_are_those_that_predict_the_held_out_data_best():
    ts = np.linspace(0.0, 2.0, 21)
    data, other = ({"t": ts, "x": 2.0 * np.exp(-k * ts)} for k in (1.0, 0.8))
    found = jaxdyn.train(_decay, 0.5, data, steps=300, validation=other, rtol=1e-9)
    assert abs(float(found.params) - 0.8) < 0.003  # between two steps of the optimiser
    assert np.argmin(found.losses) > np.argmin(found.validation_losses)
    # By hand: the first guess predicts each measurement from the last one.
    misfit = other["x"][:-1] * np.exp(-0.5 * 0.1) - other["x"][1:]
    wanted = np.mean((misfit / np.std(data["x"])) ** 2)
    assert gap(found.validation_losses[0], wanted) < 1e-8 * wanted
    assert "validation loss" in repr(found)


def test_held_out_data_are_checked_by_their_name():
    data = {"t": np.arange(5.0), "x": np.exp(-np.arange(5.0))}
    short = {"t": np.arange(1.0), "x": np.ones(1)}
    with pytest.raises(ValueError, match="validation: expected a complete row with 1 more after"):
        jaxdyn.train(_decay, 0.5, data, validation=short)


def test_held_out_data_without_a_motion_end_the_training():
    def drained(k):
        return jaxdyn.ode(lambda t, y, k: [-k * jnp.sqrt(y[0])], [1.0], 1.0, names=["x"], params=k)

    ts = np.arange(4.0)
    data, other = {"t": ts, "x": (2 - 0.1 * ts) ** 2}, {"t": ts, "x": ts - 5.0}
    found = jaxdyn.train(drained, 0.1, data, steps=3, validation=other)
    assert found.outcome == TrainingStatus.NO_MOTION
    assert np.isnan(found.validation_losses).all()
    assert "validation loss  nan before" in repr(found)


@pytest.mark.slow
def test_several_motions_are_learned_from_without_the_span_between_them(noisy):
    x = noisy["x"]
    parts = [{"t": TS[:9], "x": x[:9]}, {"t": TS[9:] + 5.0, "x": x[9:]}]
    off = np.delete(x[:-1] * np.exp(-1.0 * TS[1]) - x[1:], 8)
    found = train(parts, steps=1, validation=parts[1:])
    assert found.losses[0] == pytest.approx(np.mean(off**2) / np.std(x) ** 2, rel=1e-5)
    wanted = np.mean(off[8:] ** 2) / np.std(x) ** 2
    assert found.validation_losses[0] == pytest.approx(wanted, rel=1e-5)
    with pytest.raises(ValueError, match=r"^data: expected measurements of at least one motion"):
        train([])
