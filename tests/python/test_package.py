"""The package around the core: assets, command line, names, kernel rules."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import stickslip as ss
from stickslip import cli

ROOT = Path(__file__).resolve().parents[2]
LINT = ROOT / "tools" / "lint_kernels.py"


def test_assets_are_installed_with_the_package() -> None:
    assert "anymal_b" in ss.assets.names()
    assert ss.assets.path("anymal_b").is_file()
    with pytest.raises(ValueError, match="'anymal_b'"):
        ss.assets.path("anymal_z")


def test_every_public_name_exists_and_says_what_it_is() -> None:
    for name in ss.__all__:
        assert getattr(ss, name).__doc__, name


def test_command_tells_its_version() -> None:
    result = subprocess.run(
        [sys.executable, "-m", "stickslip.cli", "--version"], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == f"stickslip {ss.__version__}"


def test_command_without_arguments_shows_its_usage(capsys) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main([])
    assert caught.value.code == 2
    assert "paper" in capsys.readouterr().err


def test_missing_processor_features_are_named(monkeypatch, tmp_path) -> None:
    from stickslip import _cpu

    old = tmp_path / "cpuinfo"
    old.write_text("processor : 0\nflags : fpu sse2 bmi2\n")
    monkeypatch.setattr(_cpu.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(_cpu, "_CPUINFO", old)
    with pytest.raises(ImportError, match="lacks avx2, fma"):
        _cpu.check()


def test_kernels_keep_their_rules() -> None:
    result = subprocess.run([sys.executable, LINT], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout


@pytest.mark.parametrize(
    "line",
    [
        "#include <cmath>",
        "#include <vector>",
        "#include <stickslip/model.h>",
        '#include "layout/tree_layout.h"',
        '#include"layout/tree_layout.h"',
        '#include "lane/../layout/tree_layout.h"',
        '#include "backend/cpu/batch_memory.h"',
        "double y = std::sqrt(x);",
        "double y = __builtin_sin(x);",
        "__m256 y = _mm256_rsqrt_ps(x);",
        "if (bad) throw 1;",
        "double* y = new double[3];",
    ],
)
def test_kernel_rules_see_what_breaks_them(line: str, tmp_path) -> None:
    sys.path.insert(0, str(LINT.parent))
    try:
        from lint_kernels import findings
    finally:
        sys.path.pop(0)
    file = tmp_path / "kernel.h"
    file.write_text(f"// std::sort and new words in a comment are fine\n{line}\n")
    for name in ("contact/kernel.h", "step/kernel.cc", "backend/cpu/pack_lanes.h"):
        found = findings(file, name)
        assert found and all(":2:" in text for text in found)
    if line.startswith("#include"):
        assert not findings(file, "world/host.h")
