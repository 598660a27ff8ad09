"""Where the robots of the package example-robot-data lie."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path


def example_robots() -> list[Path]:
    """Every URDF file of example-robot-data; none where it is not installed."""
    try:
        package = distribution("example-robot-data")
    except PackageNotFoundError:
        return []
    root = Path(str(package.locate_file("cmeel.prefix/share/example-robot-data/robots")))
    return sorted(root.rglob("*.urdf"))
