"""Rates that are written as text: against the same by hand, and what is refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxdyn
import orbits
from jaxdyn.formulations.xpp import Maker
from jaxdyn.symbolic.parameters import parameters, with_parameters

MORRIS_LECAR = """# Morris and Lecar
params v1=-.01,v2=0.15,v3=0.1,v4=0.145,gca=1.33,phi=.333
params vk=-.7,vl=-.5 iapp=.08, gk=2.0,gl=.5,  om=1
minf(V)=.5*(1+tanh((v-v1)/v2))
ninf(v)=.5*(1+tanh((v-v3)/v4))
lamn(v)= phi*cosh((v-v3)/(2*v4))   # of the channels
ica=gca*minf(v)*(v-1)
V'= (iapp+gl*(vl-v)+ \\
   gk*w*(vk-v)-ica)*om
dw/dt = (lamn(v)*(ninf(v)-w))*om
v(0)=.05
aux current=ica
@ TOTAL=150,DT=.25,xlo=0,xhi=150
done
nothing after this is read'=
"""


def _by_hand(y, iapp=0.08):
    v, w = y
    ica = 1.33 * 0.5 * (1 + np.tanh((v + 0.01) / 0.15)) * (v - 1)
    slow = 0.333 * np.cosh((v - 0.1) / 0.29) * (0.5 * (1 + np.tanh((v - 0.1) / 0.145)) - w)
    return [iapp + 0.5 * (-0.5 - v) + 2.0 * w * (-0.7 - v) - ica, slow]


def test_a_model_of_a_neuron_is_what_it_is_by_hand():
    scene = Maker(MORRIS_LECAR)(iapp=0.2)
    assert [name for name, _ in scene.labels()] == ["v", "w"]
    assert np.array_equal(scene.y0, [0.05, 0.0])
    assert float(scene.t1) == 150.0
    for y in np.random.default_rng(0).uniform(-0.5, 0.5, (20, 2)):
        assert np.allclose(scene.rate(0.0, jnp.asarray(y)), _by_hand(y, 0.2), rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("-x^2", [-4.0, -9.0]),
        ("2^-x", [0.25, 0.125]),
        ("x^3 - x/2*3", [5.0, 22.5]),
        ("heav(x - 2.5) + sign(2 - x)", [0.0, 0.0]),
        ("if(x>2)then(if(x>=3)then(7)else(8))else(-1)", [-1.0, 7.0]),
        ("if (x==2) then (1) else (0) + 1", [2.0, 1.0]),
        ("(x>1 & x<3) + 10*(not(x<3)) + 100*((x<1) | (x>2.5))", [1.0, 110.0]),
        ("max(x, 2.5) + min(x, 1e-1) + mod(x, 2) + flr(x/2)", [3.6, 5.1]),
        ("lambda*x + ln(exp(x)) + log10(10) + pi - pi + t", [9.0, 13.0]),
        ("f(x, 2) + q", [13.0, 15.0]),
    ],
)
def test_expressions(text, values):
    model = f"p lambda=3 is=1; f(a,in)=a*in+is; !q=2^lambda; x'={text}"
    scene = Maker(model)()
    found = [float(scene.rate(0.0, jnp.asarray([x]))[0]) for x in (2.0, 3.0)]
    assert found == pytest.approx(values, abs=1e-14)


# Values of XPPAUT 6.11 for v = 3, a = 2, printed as an auxiliary quantity.
XPPAUT = {
    "1+1>2": 1.0,
    "(1+1)>2": 0.0,
    "v*2>1": 3.0,
    "3-2>1": 2.0,
    "v-1<a": 2.0,
    "2+2*2>3": 2.0,
    "4>2^3": 1.0,
    "3>2>0.5": 1.0,
    "v>2&a<3": 1.0,
    "1|0*5": 1.0,
    "2^3^2": 64.0,
    "-2^2": -4.0,
    "1-2^2": -3.0,
    "-v*a": -6.0,
    "exp(-v^2)": 0.0001234098,
    "mod(-3,5)": 2.0,
    "mod(3,-5)": 3.0,
    "flr(-1.5)": -2.0,
    "if(v+1>2)then(7)else(8)": 7.0,
    "if(1)then(2)else(3)+1": 3.0,
    "1+if(0)then(2)else(3)*2": 7.0,
    "not(2)+1": 1.0,
    "not 0": 1.0,
    "~1": -1.0,
    "(-2)^3": -8.0,
    "6/2*3": 9.0,
    "2-3-4": -5.0,
    "atan2(1,2)": 0.4636476,
    "lgamma(3.5)": 1.2009736,
    "erf(.5)": 0.52049989,
    "log(exp(1))": 1.0,
    "heav(v-3)": 1.0,
}


@pytest.mark.parametrize(("text", "expected"), XPPAUT.items())
def test_values_are_those_of_xppaut(text, expected):
    scene = Maker(f"par v=3, a=2; x'={text}")()
    assert float(scene.rate(0.0, scene.y0)[0]) == pytest.approx(expected, rel=2e-7)


def test_powers_and_quotients_of_numbers_are_those_of_arrays():
    scene = Maker("x'=1/0; y'=(-8)^(1/3); z'=10^400")()
    np.testing.assert_array_equal(scene.rate(0.0, scene.y0), [np.inf, np.nan, np.inf])


# XPPAUT starts such texts at F / w^2.
@pytest.mark.parametrize("start", ["x(0)=b", "init x=b", "x(0)=2*c-b", "x(0)=sqrt(b*b)"])
@pytest.mark.parametrize("sign", ["!", ""])
def test_starts_may_be_derived_numbers(start, sign):
    text = f"par f=3, w=2\n{sign}b=f/w^2\n{sign}c=b\n{start}\nx'=v\nv'=-w^2*x"
    make = Maker(text)
    np.testing.assert_array_equal(make().y0, [0.75, 0.0])
    assert make.defaults["x"] == 0.75


def test_rows_of_states():
    text = "par d=2; init u[0..2]=[j]\nu0'=0; u[1..3]'=d*u[j-1]+[j]; u4'=u[3]"
    scene = Maker(text)()
    assert [name for name, _ in scene.labels()] == [f"u{j}" for j in range(5)]
    np.testing.assert_array_equal(scene.y0, [0, 1, 2, 0, 0])
    np.testing.assert_array_equal(scene.rate(0.0, scene.y0), [0, 1, 4, 7, 0])


# Rates of XPPAUT 6.11 at the start, in its order of states.
BLOCKS = {
    "z0'=0\n%[1..3]\ny[j]'=[j]\nz[j]'=y[j-1]\n%\ny0'=7\ninit y[0..3]=[j]": [0, 1, 0, 2, 1, 3, 2, 7],
    "%[3..1] falling\n# each\npar a[j]=.[j]\ny[j]'=a[j]\n% end\nx'=1": [0.3, 0.2, 0.1, 1],
    "%[1..2]\ny[j]'=1+\\\n[j]\n%\n% [4..5]\ny[j]'=[j]+y[j-3]\n%": [2, 3, 4, 5],
}


@pytest.mark.parametrize(("text", "expected"), BLOCKS.items())
def test_blocks_of_rows(text, expected):
    scene = Maker(text)()
    np.testing.assert_array_equal(scene.rate(0.0, scene.y0), expected)


def test_the_end_ends_a_block():
    assert Maker("%[1..2]\ny[j]'=1\ndone\nz'=1")().y0.size == 2


def test_methods_for_differential_equations_are_left_out():
    for method in ("euler", "Runge", "5dp", "8", "disc, method=cvode"):
        assert Maker(f"x'=1\n@ total=3, meth={method}").defaults == {"x": 0.0, "total": 3.0}


def test_quantities_in_any_order_and_functions_of_time():
    text = "num k=3\nc=b+1\nb=f(2)\nf(x)=x*e\ne=k\ns(t)=t^2\npar free\nw(0)=0012.5\nw'=c+s(5)+s(t)"
    scene = Maker(text)()
    assert Maker(text).defaults == {"k": 3.0, "free": 0.0, "w": 12.5, "total": 20.0}
    assert float(scene.rate(2.0, scene.y0)[0]) == 7 + 25 + 4


def test_a_row_may_descend():
    text = "x[3..1]'=[j*2]\n@ total=3, total=4"
    assert Maker(text).defaults == {"x3": 0.0, "x2": 0.0, "x1": 0.0, "total": 4.0}
    np.testing.assert_array_equal(Maker(text)().rate(0.0, jnp.zeros(3)), [6, 4, 2])


@pytest.mark.parametrize(
    ("functions", "expected"),
    [("f(k)=g(2); g(y)=y*k", 2.0), ("f(t)=g(2)+t; g(y)=y+t", 7.0), ("f(pi)=pi*2", 10.0)],
)
def test_arguments_are_known_in_their_own_function_only(functions, expected):
    scene = Maker(f"par k=1; {functions}; x'=f(5)")()
    assert float(scene.rate(0.0, scene.y0)[0]) == expected


def test_what_says_nothing_about_rates_is_left_out():
    text = "bndry x-1\nb (x'-2)\no my.opt\naux z=undeclared\n@ total=3, t0=1, dt=.1\nx'=-x"
    assert Maker(text).defaults == {"x": 0.0, "total": 3.0}


@pytest.mark.parametrize(
    ("rate", "printed"),
    [
        ("if(t>2)then(1)else(0)", "H(t - 2)"),
        ("if(x>2)then(7)else(3)", "(7 if x > 2 else 3)"),
        ("if(not(x>2))then(7)else(3)", "(7 if not(x > 2) else 3)"),
        ("if(x>2&t<1)then(7)else(3)", "(7 if and(x > 2, t < 1) else 3)"),
        ("if((x>2)==0)then(7)else(3)", "(3 if x > 2 else 7)"),
        ("if(max(x-2,0))then(7)else(3)", "(7 if max(x - 2, 0) != 0 else 3)"),
        ("if(flr(x)==2)then(7)else(3)", "(7 if floor(x) = 2 else 3)"),
        ("if(x==2)then(7)else(3)", "3"),  # true at an isolated point only
    ],
)
def test_conditions_are_printed_as_such(rate, printed):
    scene = Maker(f"x'={rate}")()
    assert f"  x' = {printed}" in str(jaxdyn.equations(scene)).splitlines()


@pytest.mark.slow
def test_numbers_are_arguments_and_have_derivatives():
    make = Maker("par k=4, c=0\nx'=v\nv'=-k*x-c*v\ninit x=1")
    end = jaxdyn.simulate(make(k=2.0, x=0.5, total=3.0)).ys[-1]
    assert np.allclose(end[0], 0.5 * np.cos(np.sqrt(2) * 3.0), atol=1e-9)
    slope = jax.grad(lambda k: jaxdyn.simulate(make(k=k), 1.0, samples=2).ys[-1, 0])(4.0)
    assert abs(slope + np.sin(2.0) / 4) < 1e-8


def test_its_equations_have_the_names_of_its_parameters():
    scene = Maker("par k=4, c=0.5\nx'=v\nv'=-k*x-c*v\ninit x=1")()
    found = jaxdyn.equations(scene)
    assert "x'' = -c x' - k x" in str(found)
    known = parameters(scene)
    assert dict(zip(known.names, known.values.tolist(), strict=True)) == {"k": 4.0, "c": 0.5}
    other = with_parameters(scene, jnp.array([9.0, 0.0]))
    assert jaxdyn.simulate(other, np.pi / 3, samples=2).ys[-1, 0] == pytest.approx(-1.0)


def test_its_scenes_survive_their_file(tmp_path):
    make = Maker("par mu=1\nx'=y\ny'=mu*(1-x^2)*y-x\ninit x=2\n@ total=6.7", "cycle")
    orbit = orbits.find(make())
    assert orbit.period == pytest.approx(6.663286859, abs=1e-8)  # of van der Pol's oscillator
    orbits.save(tmp_path / "cycle.json", orbit)
    again, _ = orbits.load(tmp_path / "cycle.json")
    assert again.period == orbit.period
    assert again.scene.system.text == orbit.scene.system.text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "text: expected rates such as x' = -x, got none"),
        ("x'=-y", "name in x': expected one of pi, t, x, got 'y'"),
        ("x'=foo(x)", "function in x': expected one of"),
        ("x'=delay(x,1)", "got a delay: \"x'=delay"),
        ("x'=x*ran(1)", "got noise"),
        ("x'=sum(0,3)of(x)", "got a shift or a sum of states"),
        ("f(a)=a\nx'=f(x,1)", "x': expected 1 argument of f, got 2"),
        ("x'=max(x)", "x': expected 2 arguments of max, got 1"),
        ("a=b\nb=a\nx'=a", "definitions that do not need themselves, got (a needs b|b needs a)"),
        ("f(a)=f(a-1)\nx'=f(x)", "do not need themselves, got f\\(\\) needs f\\(\\)"),
        ("x'=1\n0=x-y", "got an algebraic equation"),
        ("x(t)=t+int{x}", "got an integral"),
        ("x'=t\n@ t0=1", "text: expected a start at the time 0, got t0=1"),
        ("!b=2*a\npar a=1\nx(0)=b\nx'=1", "name in x\\(0\\)=b: expected one of a, pi, got 'b'"),
        ("b=2*x\nx(0)=b\nx'=b", "name in x\\(0\\)=b: expected one of pi, got 'b'"),
        ("!b=2\npar a=b\nx'=a", "name in par a=b: expected one of pi, got 'b'"),
        ("par a=b\nx'=1", "name in par a=b: expected one of pi, got 'b'"),
        ("x[1..20000]'=1", "at most 10000 statements"),
        ("x'=" + "(" * 300 + "x" + ")" * 300, "expected parameters, starts and rates"),
        ("x'=" + "+".join("x" * 300), "expected parameters, starts and rates"),
        ("x'=__import__('os')", "expected parameters, starts and rates, got .*__import__"),
        ("x'=x.real", "expected parameters, starts and rates"),
        ("x'=[x for x in 1]", "got a part of a row"),
        ("x(t+1)=x/2", "got a map"),
        ("x'=3*x\n@ meth=discrete, total=9", "got a map: '@ meth=discrete.* See orbits.map_basins"),
        ("x'=3*x\n@ METHOD = 0", "got a map: '@ method = 0'"),
        ("x'=y\ny=0\nexport {x} {y}", "got quantities from a library: 'export"),
        ("#include more.ode\nx'=1", "got another file: '#include more.ode'. Put its lines here"),
        ("%[1..2]\nx[j]'=x[j-2]", "got a part of a row before its beginning"),
        ("%[1..99999]\nx[j]'=1", "at most 10000 statements"),
        ("wiener w\nx'=w", "got noise: 'wiener w'. No scene has noise"),
        ("w w\nx'=w", "got noise: 'w w'"),
        ("global 1 x-1 {x=0}\nx'=1", "got a reset of states"),
        ("table f f.tab\nx'=1", "got a table"),
        ("x[1..3]'=-shift(x1,[j])", "got a shift or a sum of states"),
        ("x[k]'=1", "got a part of a row"),
        ("x[1..2]'=[2*j]", "got a part of a row"),
        ("x[1..2]'=x[jj]", "got a part of a row"),
        ("x'=2*not(x)", r"`not` in parentheses behind an operator, .* Write \(not\(x\)\)"),
        ("x'=1\n@ total=3, dt=-.1", "got a run backwards in time"),
        ("par total=3\nx'=total", "one meaning of each name, got two of total"),
        ("par pi=3\nx'=pi", "one meaning of each name, got two of pi"),
        ("par a=1\na=2\nx'=a", "one meaning of each name, got two of a"),
        ("x'=1\nx'=2", "one meaning of each name, got two of x"),
        (
            "f0(x)=x\n"
            + "".join(f"f{i + 1}(x)=f{i}(x)+f{i}(x)\n" for i in range(20))
            + "x'=f20(x)",
            "at most 200000 operations",
        ),
        (
            "f0(x)=x\n" + "".join(f"f{i + 1}(x)=f{i}(x)+1\n" for i in range(300)) + "x'=f300(x)",
            "within each other at most 200 times",
        ),
        ("x[0..3]'=x[j-1]", "got a part of a row before its beginning"),
        ("x'=-x\ninit y=1", "start: expected one of x, got 'y'"),
        ("par x=1\nx'=-x", "text: expected one meaning of each name, got two of x"),
        ("x'=if(x)then(1)", "expected parameters, starts and rates"),
        ("x'=(x", "expected parameters, starts and rates"),
        ("what is this\nx'=1", "got 'what is this'"),
        ("x'=" + "-" * 5000 + "x", "expected parameters, starts and rates"),
        ("x" * 300_000, "text: expected at most 200000 characters, got 300000"),
    ],
)
def test_what_is_refused(text, message):
    with pytest.raises(ValueError, match=message):
        Maker(text)


def test_an_unknown_number_is_refused():
    with pytest.raises(ValueError, match="number: expected one of k, total, x, got 'm'"):
        Maker("par k=1\nx'=-k*x")(m=1.0)


@pytest.mark.parametrize("text", [None, ["x'=1"], "models/lorenz.ode"])
def test_what_is_no_text_is_refused(text):
    with pytest.raises(ValueError, match=r"the text of a model, .* Path\(file\).read_text"):
        Maker(text)


def test_several_numbers_are_refused():
    with pytest.raises(ValueError, match=r"k: expected one number, got shape \(2,\). Use jax.vmap"):
        Maker("par k=1\nx'=-k*x")(k=[1.0, 2.0])
