"""Groups and data sets of an HDF5 file that may be damaged: every value is checked before it is read.

A file can claim anything: a data set of 1e12 numbers costs it a hundred bytes. Nothing is allocated before the claim has been held
against what is expected and against the size of the file.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import h5py
import numpy as np
from numpy.typing import NDArray

_LARGEST_RATIO = 1100  # of deflate, the filter of HDF5 that compresses best, rounded up


def path_of(path: str | os.PathLike[str]) -> str:
    """The path as text. TypeError for something else."""
    try:
        return os.fsdecode(path)
    except TypeError:
        raise TypeError(f"path is a {type(path).__name__}; the path of a file is wanted") from None


class Group:
    """A group that knows the file's path and its own name, so that errors can tell both."""

    def __init__(self, path: str, group: h5py.Group, name: str = ""):
        self._path = path
        self._group = group
        self._name = name

    def error(self, child: str, says: str) -> ValueError:
        """`says` of this group (child empty) or of something in it."""
        name = "/".join(part for part in (self._name, child) if part)
        return ValueError(f"{self._path}: {name + ' ' if name else ''}{says}")

    def names(self) -> list[str]:
        """What is in it, sorted."""
        with self._reading(""):
            return sorted(self._group)

    def __contains__(self, child: str) -> bool:
        with self._reading(child):
            return self._group.get(child, getlink=True) is not None

    def group(self, child: str) -> Group:
        """ValueError if there is none, or something else."""
        found = self._child(child)
        if not isinstance(found, h5py.Group):
            raise self.error(child, f"is a {_kind(found)}; a group is expected")
        return Group(self._path, found, f"{self._name}/{child}" if self._name else child)

    def integer(self, child: str) -> int:
        """A single integer, of any shape that holds one."""
        dataset = self._dataset(child, "iu", "an integer")
        if dataset.size != 1:
            raise self.error(child, f"has shape {dataset.shape}; a single integer is expected")
        return int(np.ravel(self._values(child, dataset))[0])

    def integers(self, child: str, size: int, why: str) -> NDArray[np.int64]:
        """(size,) integers; `why` says where the size comes from."""
        dataset = self._dataset(child, "iu", "integers")
        self._check_size(child, dataset, size, why)
        values = self._values(child, dataset)
        if values.dtype.kind == "u" and values.size and values.max() > np.iinfo(np.int64).max:
            raise self.error(child, f"has an entry of {values.max()}; 64 bits with a sign are expected")
        return values.astype(np.int64)

    def reals(self, child: str, size: int | None = None, why: str = "", infinite: bool = False) -> NDArray[np.float64]:
        """(size,) finite numbers, or as many as there are; `infinite` allows +inf."""
        dataset = self._dataset(child, "fiu", "real numbers")
        self._check_size(child, dataset, size, why)
        with np.errstate(over="ignore"):  # of long doubles; told below
            values = self._values(child, dataset).astype(np.float64)
        bad = np.flatnonzero(~(np.isfinite(values) | (infinite & (values > 0))))
        if len(bad):
            raise self.error(f"{child}[{bad[0]}]", f"is {values[bad[0]]}; it must be finite")
        return values

    def reals_if_written(self, child: str, size: int, why: str) -> NDArray[np.float64] | None:
        """As `reals`; None for a data set of that size to which nothing was ever written."""
        dataset = self._dataset(child, "fiu", "real numbers")
        self._check_size(child, dataset, size, why)
        return None if self._unwritten(child, dataset) else self.reals(child, size, why)

    def text(self, child: str) -> str:
        """A single string."""
        dataset = self._dataset(child, "SO", "a text")
        if dataset.size != 1:
            raise self.error(child, f"has shape {dataset.shape}; a single text is expected")
        value = np.ravel(self._values(child, dataset))[0]
        if not isinstance(value, (bytes, str)):
            raise self.error(child, f"holds a {type(value).__name__}; a text is expected")
        # Old writers left bytes in other encodings; a title is no reason to refuse a problem.
        return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else value

    @contextmanager
    def _reading(self, child: str) -> Iterator[None]:
        """h5py raises KeyError, RuntimeError, OSError, TypeError and more, by what is broken; all mean the same here."""
        try:
            yield
        except MemoryError:
            raise self.error(child, "does not fit into memory") from None
        except Exception as error:
            raise self.error(
                child, f"cannot be read ({' '.join(str(error).split()) or type(error).__name__})"
            ) from None

    def _child(self, child: str) -> h5py.Group | h5py.Dataset | h5py.Datatype:
        with self._reading(child):
            link = self._group.get(child, getlink=True)
            # A problem is one file: whoever opens it must not be led to others, in one step or in two.
            away = isinstance(link, h5py.ExternalLink)
            found = None if away else self._group.get(child)
            if isinstance(link, h5py.SoftLink) and found is not None:
                away = found.file.filename != self._group.file.filename
        if link is None:
            there = ", ".join(self.names()) or "nothing"
            raise self.error(child, f"is missing; there is {there} in {self._name or 'the file'}")
        if away:
            raise self.error(child, "is a link to another file; FCLIB problems are one file")
        if found is None:
            raise self.error(child, "is a link to nothing")
        return found

    def _dataset(self, child: str, kinds: str, expected: str) -> h5py.Dataset:
        found = self._child(child)
        if not isinstance(found, h5py.Dataset):
            raise self.error(child, f"is a {_kind(found)}; a data set with {expected} is expected")
        with self._reading(child):
            dtype, shape = found.dtype, found.shape
            elsewhere = found.is_virtual or found.external is not None
        if shape is None or dtype.kind not in kinds or (dtype.kind == "O" and h5py.check_string_dtype(dtype) is None):
            what = "no value" if shape is None else f"type {dtype}"
            raise self.error(child, f"has {what}; {expected} expected")
        if elsewhere:
            raise self.error(child, "has its values in other files; FCLIB problems are one file")
        return found

    def _check_size(self, child: str, dataset: h5py.Dataset, size: int | None, why: str) -> None:
        if dataset.ndim != 1:
            raise self.error(child, f"has shape {dataset.shape}; one dimension is expected")
        if size is not None and dataset.size != size:
            raise self.error(child, f"has {dataset.size} entries; {size} are expected ({why})")

    def _unwritten(self, child: str, dataset: h5py.Dataset) -> bool:
        """HDF5 gives room to a data set when something is written to it, and fill values to who reads it before."""
        with self._reading(child):
            return dataset.size > 0 and dataset.id.get_storage_size() == 0

    def _values(self, child: str, dataset: h5py.Dataset) -> NDArray:
        """Everything in a data set, native."""
        with self._reading(child):
            claimed = dataset.size * dataset.dtype.itemsize
            held = os.path.getsize(self._path)
        if claimed > _LARGEST_RATIO * held or self._unwritten(child, dataset):
            raise self.error(child, f"claims {claimed} bytes, but was never written in full (the file has {held})")
        with self._reading(child):
            return np.asarray(dataset[()])


@contextmanager
def opened(path: str) -> Iterator[Group]:
    """The root of a file. FileNotFoundError, OSError if it cannot be read, ValueError if it is not HDF5; all with the path."""
    if not os.path.exists(path):
        raise FileNotFoundError(f"{path}: there is no such file")
    if not os.path.isfile(path):
        raise OSError(
            f"{path}: is not a file but a {'folder' if os.path.isdir(path) else 'device'}; give a problem's file"
        )
    try:
        with open(path, "rb"):
            pass
    except OSError as error:
        raise OSError(f"{path}: cannot be read ({error.strerror})") from None
    if not h5py.is_hdf5(path):
        raise ValueError(f"{path}: is not an HDF5 file; FCLIB problems are")
    try:
        file = h5py.File(path, "r")
    except Exception as error:  # h5py's classes, see Group._reading
        raise ValueError(f"{path}: is a damaged HDF5 file ({' '.join(str(error).split())})") from None
    try:
        yield Group(path, file)
    finally:
        with Group(path, file)._reading(""):
            file.close()


def _kind(thing: object) -> str:
    if isinstance(thing, h5py.Group):
        return "group"
    return "data set" if isinstance(thing, h5py.Dataset) else "named type"
