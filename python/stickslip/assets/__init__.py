"""Robot descriptions that come with stickslip."""

from __future__ import annotations

from pathlib import Path

__all__ = ["names", "path"]

_FOLDER = Path(__file__).parent


def names() -> list[str]:
    """Names that `path` knows."""
    return sorted(folder.name for folder in _FOLDER.iterdir() if (folder / f"{folder.name}.urdf").is_file())


def path(name: str) -> Path:
    """The URDF file of a robot that comes with the package, as in `world.add_robot(assets.path("anymal_b"))`.

    Raises ValueError that lists the names.
    """
    file = _FOLDER / name / f"{name}.urdf"
    if name not in names():
        raise ValueError(f"no robot is called {name!r}; choose one of {', '.join(map(repr, names()))}")
    return file
