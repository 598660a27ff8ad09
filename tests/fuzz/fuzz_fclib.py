"""Damaged FCLIB files: reading may refuse them by name, and nothing else.

    python tests/fuzz/fuzz_fclib.py [--seed N] [--count N] [--kind structure|bytes] [--folder F]

runs until it is stopped, or `--count` cases. Case k is made from seed + k alone: `--seed (that sum) --count 1` makes it again. A case
that fails, hangs or crashes stays in the folder as case_<seed>.hdf5. `--atheris` lets the coverage-guided fuzzer of that name,
if it is installed, choose the bytes instead; other options go to it.

What must hold for every file: `read` and `load` return, or raise ValueError or OSError with the file's path; they take little
memory, whatever the file claims; what was read can be written and read again; what was loaded is finite.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import functools
import itertools
import sys
import tempfile
import tracemalloc
import warnings
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

if "--atheris" in sys.argv:
    import atheris

    with atheris.instrument_imports(include=["stickslip.fclib"]):
        from stickslip import fclib
else:
    from stickslip import fclib

Rng = np.random.Generator

LARGEST_PEAK = 100 << 20  # bytes; the files have some 20 kB
LONGEST_CASE = 30  # s

INTEGERS = [0, 1, -1, -2, -3, 2, 3, 4, 5, 12, 255, 2**15, 2**31 - 1, -(2**31), 2**32, 2**53, 2**63 - 1, -(2**63)]
REALS = [0.0, -0.0, 1.0, -1.0, 1e-320, 1e-308, 1e16, 1e150, 1.7e308, -1e308, np.inf, -np.inf, np.nan]
TYPES = ["i1", "u1", ">i4", "i8", "u8", "f2", "f4", ">f8", "g", "c16", "bool", "S3", "S0", "V4", h5py.string_dtype()]
SHAPES = [(), (0,), (1,), (2,), (3,), (1, 1), (4, 3), (0, 5), (13,), (1000,)]


# Files to begin with


@functools.cache
def seed_files() -> list[bytes]:
    """Both forms, with and without constraints, in space and in the plane, in every storage."""
    rng = np.random.default_rng(0)
    local = fclib.LocalProblem(_definite(rng, 12), rng.normal(size=12), [0.1, 0.2, 0.3, 0.4])
    planar = fclib.LocalProblem(_definite(rng, 4), rng.normal(size=4), [0.5, 0.6], spacedim=2)
    A = _definite(rng, 8)
    tied = fclib.LocalProblem(A[:6, :6], rng.normal(size=6), [0.1, 0.2], 3, A[:6, 6:], A[6:, 6:], [1.0, 2.0])
    bodies = fclib.GlobalProblem(
        _definite(rng, 7), rng.normal(size=(7, 6)), rng.normal(size=7), rng.normal(size=6), [0.5, 0.5]
    )
    hinged = fclib.GlobalProblem(
        bodies.M, bodies.H, bodies.f, bodies.w, bodies.mu, G=rng.normal(size=(7, 2)), b=rng.normal(size=2)
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "seed.hdf5"
        files = []
        for problem in (local, planar, tied, bodies, hinged):
            for storage in ("csr", "csc", "triplet"):
                _write_seed(path, problem, storage)
                files.append(path.read_bytes())
    return files


def _definite(rng: Rng, size: int) -> np.ndarray:
    A = rng.normal(size=(size, size)) * (rng.random((size, size)) < 0.5)
    return A @ A.T + np.eye(size)


def _write_seed(path: Path, problem: fclib.LocalProblem | fclib.GlobalProblem, storage: str) -> None:
    rng = np.random.default_rng(1)
    m = problem.spacedim * problem.num_contacts
    sizes = {"u": m, "r": m}
    if isinstance(problem, fclib.GlobalProblem):
        sizes["v"] = len(problem.f)
        if problem.b is not None:
            sizes["l"] = len(problem.b)
    elif problem.s is not None:
        sizes["l"] = len(problem.s)
    solutions = [fclib.Solution(**{name: rng.normal(size=size) for name, size in sizes.items()}) for _ in range(3)]
    fclib.write(
        path,
        problem,
        storage=storage,
        title="A title",
        description="text",
        solution=solutions[0],
        guesses=solutions[1:],
    )


# Changes of the structure


def _names(file: h5py.File, kind: type = object) -> list[str]:
    names: list[str] = []
    file.visititems(lambda name, thing: names.append(name) if isinstance(thing, kind) else None)
    return names


def _pick(rng: Rng, file: h5py.File, kind: type = object) -> str:
    names = _names(file, kind)
    if kind is h5py.Dataset:  # what an earlier change only claims cannot be read here either
        names = [name for name in names if (file[name].size or 0) <= 10**6]
    return str(rng.choice(names)) if names else ""


def _put(file: h5py.File, name: str, value: object) -> None:
    if name in file:
        del file[name]
    file[name] = value


def drop(rng: Rng, file: h5py.File) -> None:
    if name := _pick(rng, file):
        del file[name]


def rename(rng: Rng, file: h5py.File) -> None:
    """To the place of something else, or to nowhere."""
    old, new = _pick(rng, file), _pick(rng, file)
    if rng.random() < 0.3:
        new = old + str(rng.choice(["x", "_rolling", "é"]))
    if old and new and not new.startswith(old) and not old.startswith(new):
        if new in file:
            del file[new]
        file.move(old, new)


def copy(rng: Rng, file: h5py.File) -> None:
    """The content of one thing in the place of another."""
    old, new = _pick(rng, file), _pick(rng, file)
    if old and not new.startswith(old) and not old.startswith(new):
        del file[new]
        file.copy(old, new)


def change_kind(rng: Rng, file: h5py.File) -> None:
    """A group for a data set and the reverse, a type, an empty space, links that go round, out or nowhere."""
    if not (name := _pick(rng, file)):
        return
    parent = name.rpartition("/")[0] or "/"
    del file[name]
    match rng.integers(7):
        case 0:
            file.create_group(name)
        case 1:
            file[name] = 1.0
        case 2:
            file[name] = np.dtype("f8")
        case 3:
            file[name] = h5py.Empty("f8")
        case 4:
            file[name] = file[parent]  # a group in itself
        case 5:
            file[name] = h5py.SoftLink(str(rng.choice(["/" + name, "/nowhere", "/", "/fclib_local/W"])))
        case 6:
            file[name] = h5py.ExternalLink(str(rng.choice(["nowhere.hdf5", file.filename])), "/" + name)


def change_type(rng: Rng, file: h5py.File) -> None:
    if name := _pick(rng, file, h5py.Dataset):
        with np.errstate(all="ignore"):
            kind = TYPES[rng.integers(len(TYPES))]
            try:
                value = np.asarray(file[name][()]).astype(kind)
            except (TypeError, ValueError):
                value = np.zeros(3, dtype=kind) if isinstance(kind, str) else "text"
        _put(file, name, value)


def change_shape(rng: Rng, file: h5py.File) -> None:
    if name := _pick(rng, file, h5py.Dataset):
        value = np.asarray(file[name][()])
        if rng.random() < 0.5 and value.ndim == 1:
            value = value[: rng.integers(len(value) + 1)] if rng.random() < 0.5 else np.append(value, value[:1])
        elif value.size:
            value = np.resize(value, SHAPES[rng.integers(len(SHAPES))])
        if value.dtype.kind != "O":
            _put(file, name, value)


def change_values(rng: Rng, file: h5py.File) -> None:
    """One number, or all, to something extreme; nothing else changes."""
    name = _pick(rng, file, h5py.Dataset)
    if not name or (dataset := file[name]).dtype.kind not in "iuf" or not dataset.size:
        return
    value = dataset[()]
    if dataset.dtype.kind == "f":
        new = REALS[rng.integers(len(REALS))]
    else:
        new = INTEGERS[rng.integers(len(INTEGERS))]
        if rng.random() < 0.5 and not np.iinfo(dataset.dtype).min <= new <= np.iinfo(dataset.dtype).max:
            value = np.asarray(value, dtype=np.int64)
        limits = np.iinfo(value.dtype)
        new = min(max(new, limits.min), limits.max)
    if rng.random() < 0.1:
        value = np.full_like(value, new)
    else:
        with np.errstate(over="ignore"):
            value.reshape(-1)[rng.integers(value.size)] = new
    _put(file, name, value)


def shuffle_values(rng: Rng, file: h5py.File) -> None:
    if name := _pick(rng, file, h5py.Dataset):
        value = np.asarray(file[name][()])
        if value.ndim == 1 and value.dtype.kind in "iuf":
            _put(file, name, rng.permutation(value))


def claim(rng: Rng, file: h5py.File) -> None:
    """A data set that says it is large and holds nothing, or is stored in another way."""
    if not (name := _pick(rng, file, h5py.Dataset)):
        return
    old = file[name]
    shape, kind = old.shape, old.dtype
    value = old[()]
    del file[name]
    match rng.integers(4):
        case 0:
            file.create_dataset(name, shape=(int(rng.choice([12, 10**6, 10**9, 10**13])),), dtype=kind, chunks=(12,))
        case 1:
            file.create_dataset(name, shape=shape, dtype=kind)
        case 2:
            big = (int(rng.choice([12, 10**5, 10**7])),)
            file.create_dataset(name, shape=big, dtype="f8", chunks=(1000,), compression="gzip")[:10] = 1.0
        case 3 if np.ndim(value) == 1 and kind.kind in "iuf" and len(value):
            file.create_dataset(name, data=value, chunks=(5,), maxshape=(None,), compression="gzip", shuffle=True)


STRUCTURE: list[Callable[[Rng, h5py.File], None]] = [
    drop,
    rename,
    copy,
    change_kind,
    change_type,
    change_shape,
    change_values,
    change_values,
    change_values,
    shuffle_values,
    claim,
]


def mutate_structure(rng: Rng, path: Path) -> None:
    """One to four changes of groups and data sets, so that the file stays HDF5."""
    with h5py.File(path, "r+") as file:
        for _ in range(rng.integers(1, 5)):
            with contextlib.suppress(ValueError, KeyError, RuntimeError, OSError, TypeError, AttributeError):
                # Two changes may not go together, such as one inside of a link that leads nowhere.
                STRUCTURE[rng.integers(len(STRUCTURE))](rng, file)


def mutate_bytes(rng: Rng, path: Path) -> None:
    """Changes of bytes that know nothing of HDF5."""
    data = bytearray(path.read_bytes())
    for _ in range(rng.integers(1, 5)):
        at = int(rng.integers(len(data)))
        match rng.integers(6):
            case 0:
                data[at] ^= 1 << int(rng.integers(8))
            case 1:
                data[at] = int(rng.choice([0, 1, 127, 128, 255]))
            case 2:
                data[at : at + 8] = int(rng.choice(INTEGERS)).to_bytes(8, "little", signed=True)[: len(data) - at]
            case 3:
                end = at + int(rng.integers(1, 64))
                start = int(rng.integers(len(data)))
                data[at:end] = data[start : start + len(data[at:end])]
            case 4:
                data[at : at + 64] = bytes(len(data[at : at + 64]))
            case 5 if len(data) > 100 and rng.random() < 0.1:
                del data[at:]
        if not data:
            break
    path.write_bytes(data)


MUTATIONS = {"structure": mutate_structure, "bytes": mutate_bytes}


# What must hold


def check(path: Path) -> bool:
    """Reads a file; AssertionError if that goes another way than it may. Returns whether it was a problem."""
    tracemalloc.start()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of slight asymmetry
            problem = _refused_by_name(path, fclib.read)
            loaded = _refused_by_name(path, fclib.load)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak <= LARGEST_PEAK, f"{path}: {peak} bytes of memory for {path.stat().st_size} of file"
    if problem is not None:
        again = path.with_suffix(".again")
        fclib.write(again, problem)
        assert type(fclib.read(again)) is type(problem)
        again.unlink()
    if loaded is not None:
        delassus = loaded.dense_delassus()
        assert np.isfinite(delassus).all()
        assert delassus.shape == (3 * loaded.num_contacts, 3 * loaded.num_contacts)
        assert np.isfinite(loaded.free_velocity).all() and (loaded.friction >= 0).all()
    return problem is not None


def _refused_by_name(path: Path, function: Callable[[Path], object]) -> object:
    try:
        return function(path)
    except (ValueError, OSError) as error:
        assert type(error) in (ValueError, OSError), f"{path}: a {type(error).__name__} ({error})"
        assert str(error).startswith(f"{path}: "), f"{path}: an error that does not say so: {error}"
        return None


def run_case(folder: Path, seed: int, kind: str) -> bool:
    """Makes a file, checks it, removes it. Returns whether it was a problem."""
    rng = np.random.default_rng(seed)
    files = seed_files()
    path = folder / f"case_{seed}.hdf5"
    path.write_bytes(files[rng.integers(len(files))])
    MUTATIONS[kind](rng, path)
    was_problem = check(path)
    path.unlink()
    return was_problem


def _atheris(folder: Path, rest: list[str]) -> None:
    path = folder / "case_atheris.hdf5"

    def one(data: bytes) -> None:
        path.write_bytes(data)
        check(path)

    corpus = folder / "corpus"
    corpus.mkdir(exist_ok=True)
    for k, content in enumerate(seed_files()):
        (corpus / f"seed_{k}.hdf5").write_bytes(content)
    atheris.Setup([sys.argv[0], *rest, str(corpus)], one)
    atheris.Fuzz()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=0, help="of the first case")
    parser.add_argument("--count", type=int, help="cases; without it runs until it is stopped")
    parser.add_argument("--kind", choices=[*MUTATIONS], help="without it both, in turn")
    parser.add_argument("--folder", type=Path, help="for the files; a new temporary one")
    parser.add_argument("--atheris", action="store_true", help="coverage-guided; other options go to it")
    options, rest = parser.parse_known_args()
    if rest and not options.atheris:
        parser.error(f"unknown: {' '.join(rest)}")
    folder = options.folder or Path(tempfile.mkdtemp(prefix="fuzz_fclib_"))
    folder.mkdir(parents=True, exist_ok=True)
    print(f"files in {folder}", flush=True)
    if options.atheris:
        _atheris(folder, rest)
    faulthandler.enable()
    problems = 0
    cases = (
        itertools.count(options.seed) if options.count is None else range(options.seed, options.seed + options.count)
    )
    for done, seed in enumerate(cases, 1):
        faulthandler.dump_traceback_later(LONGEST_CASE, exit=True)  # HDF5 in an endless loop hears no signal
        problems += run_case(folder, seed, options.kind or ("structure", "bytes")[seed % 2])
        faulthandler.cancel_dump_traceback_later()
        if done % 1000 == 0 or done == options.count:
            print(f"{done} cases, {problems} of them still problems", flush=True)


if __name__ == "__main__":
    main()
