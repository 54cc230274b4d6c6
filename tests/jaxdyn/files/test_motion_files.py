"""Motion files: what goes in comes out to the bit, and nothing hostile gets in."""

import dataclasses
import io
import json
import re
import zipfile

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers import refusal, run_python

import jaxdyn
from jaxdyn import Status, Trajectory, scenes, simulate, solvers, vibration
from jaxdyn.files import archives, digests
from jaxdyn.integrate.phases import HybridTrajectory
from jaxdyn.scenes import catalogue


def made(scene) -> Trajectory:
    """A motion of two samples that nobody computed."""
    return Trajectory(
        scene=scene,
        ts=jnp.array([-0.0, 1 / 3]),
        ys=jnp.stack([scene.y0, scene.y0 + 1e-310]),
        steps=jnp.asarray(7),
        rejected=jnp.asarray(0),
        status=jnp.asarray(0),
        stiff=jnp.asarray(True),
    )


def batch() -> Trajectory:
    speeds = jnp.array([[5.0, 10.0, 20.0]])
    throw = jax.vmap(jax.vmap(lambda v: simulate(scenes.cannonball(speed=v), 1.0, samples=2)))
    return throw(speeds)


def failed() -> Trajectory:
    return simulate(scenes.cannonball(speed=1e200, drag=1.0), samples=3, throw=False)


def chain() -> HybridTrajectory:
    """A ball that bounces twice, in pieces that nobody computed, and then fails."""
    first, last = made(scenes.cannonball()), failed()
    return HybridTrajectory(
        names=("fly", "fly again"),
        pieces=(first, last),
        t=jnp.asarray(jnp.nan),
        y=jnp.full(4, jnp.nan),
        ended=False,
        status=Status.STEP_COLLAPSED,
        path=(("fly", 0),),
    )


MOTIONS = {
    "backwards": lambda: simulate(scenes.oscillator(), 0.0, t0=1.0, samples=3),
    "fixed": lambda: simulate(scenes.oscillator(), solver=solvers.KAHAN_LI8, dt=0.5, samples=2),
    "digits": lambda: simulate(scenes.oscillator(), 1.0, samples=3, digits=6),
    "batch": batch,
    "failed": failed,
    "chain": chain,
    "driven": lambda: simulate(
        vibration.drive(scenes.oscillator(), "x", vibration.Harmonic(1.0, 2.0)), 1.0, samples=3
    ),
}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "motion.npz"


def through_file(motion, path):
    motion.save(path)
    return jaxdyn.load(path)


def assert_equal_to_the_bit(back, motion):
    assert type(back) is type(motion)
    assert jax.tree.structure(back) == jax.tree.structure(motion)
    for a, b in zip(jax.tree.leaves(back), jax.tree.leaves(motion), strict=True):
        a, b = np.asarray(a), np.asarray(b)
        assert (a.shape, a.dtype) == (b.shape, b.dtype)
        assert a.tobytes() == b.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("name", catalogue.entries())
def test_a_motion_of_every_scene_comes_back_to_the_bit(name, path):
    motion = made(catalogue.entries()[name].make())
    assert_equal_to_the_bit(through_file(motion, path), motion)


@pytest.mark.sample("failed", "chain", "driven")
@pytest.mark.parametrize("name", MOTIONS)
def test_every_kind_of_motion_comes_back_to_the_bit(name, path):
    motion = MOTIONS[name]()
    back = through_file(motion, path)
    assert_equal_to_the_bit(back, motion)
    assert repr(back) == repr(motion)
    assert back.message == motion.message


@pytest.mark.slow
@pytest.mark.parametrize("name", ["car", "cylinder_on_cylinder"])
def test_the_phases_of_a_scene_come_back_to_the_bit(name, path):
    entry = catalogue.entries()[name]
    motion = entry.motion(entry.make(), samples=3)
    assert_equal_to_the_bit(through_file(motion, path), motion)


@pytest.mark.slow
def test_what_is_read_warns_as_what_was_saved(path):
    motion = simulate(scenes.oscillator(), solver=solvers.VERLET, dt=1.5, samples=3)
    back = through_file(motion, path)
    assert back.method is solvers.VERLET
    assert back.warning == motion.warning != ""


@pytest.mark.slow
def test_numpy_reads_the_samples(path):
    motion = batch()
    motion.save(path)
    with np.load(path) as file:
        assert np.array_equal(file["ys"], motion.ys)
        assert np.array_equal(file["scene.y0"], motion.scene.y0)
        assert json.loads(file["motion.json"])["pieces"][0]["scene"]["name"] == "cannonball"
    chain().save(path)
    with np.load(path) as file:
        assert np.array_equal(file["1/ts"], chain().pieces[1].ts)


def test_the_same_motion_gives_the_same_file(path):
    made(scenes.pendulum()).save(path)
    before = path.read_bytes()
    made(scenes.pendulum()).save(path)
    assert path.read_bytes() == before


def decay(rate, y0=1.0):
    """A scene with a function, which no file holds."""
    return jaxdyn.ode(lambda t, y, p: [-p * y[0]], [y0], 1.0, params=rate)


def test_a_motion_of_a_scene_with_functions_comes_back_with_the_scene(path):
    motion = made(decay(2.0))
    motion.save(path)
    back = jaxdyn.load(path, scene=decay(3.0, 5.0))  # its numbers are those of the file
    assert_equal_to_the_bit(back, dataclasses.replace(motion, scene=back.scene))
    assert back.scene.y0.tolist() == [1.0]
    assert simulate(back.scene, 1.0).ys[-1, 0] == pytest.approx(np.exp(-2.0), abs=1e-12)
    several = jax.vmap(lambda rate: simulate(decay(rate), samples=3))(jnp.array([1.0, 2.0]))
    several.save(path)
    back = jaxdyn.load(path, scene=decay(3.0))
    assert np.array_equal(back.ys, several.ys)
    assert np.array_equal(back.scene.system.params, [1.0, 2.0])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (None, "scene: expected the scene .*, with any values of its numbers, got none. Pass it"),
        (jaxdyn.ode(lambda t, y, p: [p * y[0]], [1.0], 1.0, params=2.0), "got others. Numbers"),
        (
            jaxdyn.ode(lambda t, y, p: [-p[0] * y[0]], [1.0], 1.0, params=jnp.array([2.0])),
            r"expected one with the entries y0 and the numbers of the file, got y0, .*\(1,\)",
        ),
        (scenes.pendulum(), "expected one with the entries y0"),
    ],
)
def test_a_scene_with_other_functions_is_refused(path, given, message):
    made(decay(2.0)).save(path)
    with pytest.raises(ValueError, match=message):
        jaxdyn.load(path, scene=given)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda m: dataclasses.replace(m, scene=m.scene.starting([1.0, jnp.nan])),
            "record: expected finite numbers, got Array",
        ),
        (
            lambda m: eqx.tree_at(lambda m: m.ys, m, m.ys.at[0, 0].set(jnp.inf)),
            "ys: expected finite numbers, or NaN where a motion failed, got others",
        ),
        (
            lambda m: eqx.tree_at(lambda m: m.ys, m, m.ys.at[0, 0].set(jnp.nan)),
            "ys: expected finite numbers, or NaN where a motion failed, got others",
        ),
        (lambda m: eqx.tree_at(lambda m: m.ts, m, m.ts[:0]), r"ts: expected float of shape \(0,\)"),
    ],
)
def test_what_is_no_motion_is_not_saved(change, message, path):
    with pytest.raises(ValueError, match=message):
        change(made(scenes.pendulum())).save(path)
    assert not path.exists()


def test_a_method_of_fixed_step_that_has_no_name_here_is_not_saved(path):
    midpoint = solvers.from_diffrax(diffrax.Midpoint())
    motion = dataclasses.replace(made(scenes.pendulum()), method=midpoint, dt=jnp.asarray(0.1))
    with pytest.raises(ValueError, match=r"method: expected one of jaxdyn\.solvers, got Midpoint"):
        motion.save(path)
    # As the message says.
    assert through_file(dataclasses.replace(motion, method=None), path).dt == 0.1


def test_traced_motions_and_other_names_of_files_are_refused(path, tmp_path):
    with pytest.raises(ValueError, match=r"motion: expected numbers, got values traced"):
        jax.jit(lambda m: m.save(path))(made(scenes.pendulum()))
    with pytest.raises(ValueError, match=r"path: expected a file name ending in \.npz"):
        made(scenes.pendulum()).save(tmp_path / "motion.json")
    with pytest.raises(ValueError, match=r"path: expected a file in a folder that exists"):
        made(scenes.pendulum()).save(tmp_path / "none" / "motion.npz")


def test_a_motion_that_is_too_large_is_neither_saved_nor_read(path, monkeypatch):
    made(scenes.pendulum()).save(path)
    monkeypatch.setattr(archives, "MAX_BYTES", 1000)
    with pytest.raises(ValueError, match=r"path: expected at most 1000 bytes, got more"):
        jaxdyn.load(path)
    with pytest.raises(ValueError, match=r"file: expected at most 1000 bytes, .*Save fewer"):
        made(scenes.pendulum()).save(path)


def test_32_bit_floats_are_refused(path):
    made(scenes.pendulum()).save(path)
    code = f"import jaxdyn\ntry: jaxdyn.load({str(path)!r})\nexcept ValueError as e: print(e)"
    assert run_python(code).startswith("floats: expected 64-bit floats")


def packed(x) -> bytes:
    """An array as an entry of an archive."""
    file = io.BytesIO()
    np.save(file, x, allow_pickle=True)
    return file.getvalue()


def claiming(shape, dtype="<f8") -> bytes:
    """An entry with a header for an array of this shape, and 8 bytes."""
    file = io.BytesIO()
    header = {"descr": dtype, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, header)
    return file.getvalue() + bytes(8)


def edit(path, entries=(), record=(), way=zipfile.ZIP_STORED) -> None:
    """Replace entries of an archive, or of its record by their dotted names; None deletes."""
    with zipfile.ZipFile(path) as archive:
        found = {name: archive.read(name) for name in archive.namelist()}
    inside = json.loads(found["motion.json"])
    for name, value in dict(record).items():
        *parents, last = [int(key) if key.isdigit() else key for key in name.split(".")]
        at = inside
        for key in parents:
            at = at[key]
        at[last] = value
    found["motion.json"] = json.dumps(inside).encode()
    found |= {
        name: x if isinstance(x, bytes | None) else packed(x) for name, x in dict(entries).items()
    }
    with zipfile.ZipFile(path, "w", way) as archive:
        for name, data in found.items():
            if data is not None:
                archive.writestr(name, data)
    redigest(path)


def redigest(path) -> None:
    """Give an archive the digest of its bytes, whatever they are."""
    with zipfile.ZipFile(path, "a") as archive:
        archive.comment = b"digest: " + bytes(digests.DIGITS)
    data = path.read_bytes()[: -digests.DIGITS]
    path.write_bytes(digests.with_digest(data, len(data)))


#: Edited arrays of a single motion of a pendulum.
ARRAYS = [
    ("ys.npy", np.array([[1.0, None]]), r"entry ys\.npy: expected rows of .*, got object"),
    ("ys.npy", packed(np.zeros((2, 2), "<f4")), r"expected rows of .*, got float32"),
    ("ys.npy", packed(np.zeros((2, 2), ">f8")), r"expected rows of .*, got >f8"),
    ("ys.npy", packed(np.zeros(2, [("a", "<f8")])), r"expected rows of .*, got \[\('a'"),
    ("ys.npy", np.asfortranarray(np.eye(2)[:, ::-1]), r"expected rows of .*, got float64"),
    ("ys.npy", claiming((10**12, 10**6)), r"expected a shape of 8 bytes, got \(1000000000000, "),
    ("ys.npy", claiming((-1, -1)), r"expected a shape of 8 bytes, got \(-1, -1\)"),
    ("ys.npy", claiming((0, 10**18)), r"expected a shape of 8 bytes"),
    ("ys.npy", b"", r"entry ys\.npy: expected an array \(\.npy\)"),
    ("ys.npy", b"\x93NUMPY\x01\x00\xff\xff{", r"entry ys\.npy: expected an array \(\.npy\)"),
    ("ys.npy", b"\x93NUMPY\x02\x00" + bytes(99), r"expected an array .*another version"),
    (
        "ys.npy",
        np.zeros((3, 2)),
        r"ys: expected float of shape \(2, 2\), got float64 of shape \(3,",
    ),
    ("ys.npy", np.full((2, 2), np.nan), r"ys: expected finite numbers, or NaN where"),
    ("ys.npy", None, r"a complete motion, got KeyError 'ys'"),
    ("ts.npy", np.zeros(()), r"ts: expected float of shape"),
    ("ts.npy", np.array([0.0, np.nan]), r"ts: expected finite numbers, got others"),
    ("ts.npy", np.zeros((10**5, 2)), r"ys: expected float of shape \(100000, 2, 2\)"),
    ("steps.npy", np.array(-1), r"steps: expected counts >= 0"),
    ("steps.npy", np.array(1.0), r"steps: expected int of shape \(\), got float64"),
    ("status.npy", np.array(99), r"status: expected codes from 0 to 15, got 99"),
    ("more.npy", np.zeros(3), r"the entries of a motion, got also 'more'"),
    ("../../evil.npy", np.zeros(3), r"the entries of a motion, got also '\.\./"),
    ("motion.json", b"[" * 100_000, r"file: expected JSON"),
    ("motion.json", b"[]", r"format 'jaxdyn-motion', got 'list'"),
    ("motion.json", None, r"expected an archive with the entry motion\.json"),
]


@pytest.mark.parametrize(("name", "data", "message"), ARRAYS)
def test_edited_arrays_are_refused(name, data, message, path):
    made(scenes.pendulum()).save(path)
    edit(path, {name: data})
    text = refusal(lambda: jaxdyn.load(path))
    assert len(text) < 500
    assert re.search(message, text), text


RECORDS = [
    ("format", "jaxdyn-orbit", r"format 'jaxdyn-motion', got 'jaxdyn-orbit'"),
    ("version", 3, r"version 2, got 3"),
    ("pieces", [], r"one motion, or a chain, got 0 motions"),
    ("pieces", 3, r"a complete motion, got TypeError"),
    ("pieces", [{}], r"scene, method and error of each motion, got \[\]"),
    ("pieces", [[]], r"a complete motion, got AttributeError"),
    ("pieces.0.method", "os.system", r"a method of jaxdyn\.solvers, got 'os\.system'"),
    ("pieces.0.method", [], r"a complete motion, got TypeError"),
    ("pieces.0.method", "RK4", r"the step dt of a method of fixed step, got none"),
    ("pieces.0.error", {"kind": "sure"}, r"the words kind, solver, other|KeyError 'error/ts'"),
    ("pieces.0.scene", None, r"scene: expected a Scene, got NoneType"),
    ("pieces.0.scene.type", "subprocess.Popen", r"scene: expected the name of a class that is imp"),
    ("pieces.0.scene.type", "UniformGravity", r"scene: expected the fields of UniformGravity"),
    ("pieces.0.scene.system", {"type": "Popen"}, r"scene\.system: expected the name of a class"),
    ("pieces.0.scene.t1", [], r"t1: expected one number, got shape \(0,\)"),
    ("pieces.0.scene.y0", [1.0], r"y0: expected shape \(2,\)"),
    ("pieces.0.scene.system.mechanism.m", -1.0, r"expected > 0, got -1"),
    ("chain", {}, r"record\.|scene, |names, path, end and status|KeyError"),
    ("chain", 3, r"a complete motion, got"),
]


@pytest.mark.parametrize(("name", "value", "message"), RECORDS)
def test_edited_records_are_refused(name, value, message, path):
    made(scenes.pendulum()).save(path)
    edit(path, record={name: value})
    text = refusal(lambda: jaxdyn.load(path))
    assert len(text) < 500
    assert re.search(message, text), text


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("chain.names", ["fly"]),
        ("chain.names", [1, 2]),
        ("chain.names", "ab"),
        ("chain.path", [["fly", -1]]),
        ("chain.path", [["fly"]]),
        ("chain.path", [[0, 0]]),
        ("chain.ended", 1),
        ("chain.status", "OK"),
        ("chain.status", "FINE"),
        ("chain.more", 1),
    ],
)
def test_edited_chains_are_refused(name, value, path):
    chain().save(path)
    edit(path, record={name: value})
    assert "a motion file with" in refusal(lambda: jaxdyn.load(path))


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("y.npy", np.array([np.inf, 0, 0, 0]), r"a chain that fit each other"),
        ("t.npy", np.array(1), r"a chain that fit each other"),
        ("2/ts.npy", np.zeros(2), r"got also '2/ts'"),
        ("1/more.npy", np.zeros(2), r"got also '1/more'"),
        ("1/ts.npy", None, r"a complete motion, got KeyError 'ts'"),
    ],
)
def test_edited_arrays_of_chains_are_refused(name, data, message, path):
    chain().save(path)
    edit(path, {name: data})
    assert re.search(message, refusal(lambda: jaxdyn.load(path)))


def test_edited_numbers_of_the_scenes_of_a_batch_are_refused(path):
    batch().save(path)
    for data, message in (
        (np.zeros((1, 2, 4)), r"scene\.y0: expected float of shape \(1, 3, 4\)"),
        (np.full((1, 3, 4), np.nan), r"scene\.y0: expected finite numbers"),
        (None, r"a complete motion, got KeyError 'scene\.y0'"),
    ):
        edit(path, {"scene.y0.npy": data})
        assert re.search(message, refusal(lambda: jaxdyn.load(path)))


def test_a_bomb_is_not_unpacked(path):
    made(scenes.pendulum()).save(path)
    edit(path, {"ys.npy": np.zeros(10**6)}, way=zipfile.ZIP_DEFLATED)
    assert "compressed entries, which may hide any size" in refusal(lambda: jaxdyn.load(path))


def test_entries_that_share_bytes_are_not_multiplied(path):
    made(scenes.pendulum()).save(path)
    data = bytearray(path.read_bytes()[: -digests.DIGITS])
    # The central directory claims 2 GB for its first entry.
    at = data.index(b"PK\x01\x02")
    data[at + 20 : at + 28] = (2 * 10**9).to_bytes(4, "little") * 2
    path.write_bytes(digests.with_digest(bytes(data), len(data)))
    assert "expected an archive (.npz)" in refusal(lambda: jaxdyn.load(path))


def test_two_entries_of_one_name_are_refused(path):
    made(scenes.pendulum()).save(path)
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr("ys.npy", packed(np.zeros((2, 2))))
    redigest(path)
    assert "two entries of one name" in refusal(lambda: jaxdyn.load(path))


def test_a_file_that_older_versions_wrote_is_read(path):
    motion = made(scenes.pendulum())
    motion.save(path)
    edit(path, record={"version": 1})
    with zipfile.ZipFile(path, "a") as archive:
        archive.comment = b""
    assert_equal_to_the_bit(jaxdyn.load(path), motion)
    edit(path, record={"version": 2})
    with zipfile.ZipFile(path, "a") as archive:
        archive.comment = b""
    assert "a digest at its end, got none" in refusal(lambda: jaxdyn.load(path))


@pytest.mark.parametrize("content", [b"", b"PK", bytes(1000), b"PK\x05\x06" + bytes(18)])
def test_what_is_no_archive_is_refused(content, path):
    path.write_bytes(content)
    assert "path: expected an archive" in refusal(lambda: jaxdyn.load(path))


def test_json_without_a_kind_is_refused(path):
    path.write_bytes(b"{}")
    said = refusal(lambda: jaxdyn.load(path))
    assert "path: expected a file of a kind that is read here" in said


def test_folders_and_devices_are_refused(tmp_path):
    for path in (tmp_path, tmp_path / "none.npz", "/dev/zero"):
        assert refusal(lambda path=path: jaxdyn.load(path)).startswith("path: expected a ")
