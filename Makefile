# make run     installs into .venv and runs the paper's experiments (results in report/)
# make test    all C++ and Python tests
# make lint    formatting and kernel rules;  make format  mends the formatting
# make bench   stickslip beside MuJoCo on the same tasks (BENCH="..." for its options)
# make bench-contact   its contact solver beside those of Pinocchio and Siconos
# make sanitize  C++ tests with address and undefined-behavior sanitizers
# make test-arm  C++ tests compiled for ARM, in an emulator (needs a cross compiler and QEMU)
#
# Needs a C++20 compiler and Python >= 3.10 with venv; everything else comes into .venv with pip.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
BUILD := build/python
OUTPUT ?= report
PAPER ?=
export CMAKE_BUILD_PARALLEL_LEVEL ?= $(shell nproc 2>/dev/null || echo 2)
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# A PYTHONPATH or an active environment of the caller must not leak into ours.
unexport PYTHONPATH PYTHONHOME

CXX_FILES = $(shell find include src scenes python tests benchmarks -name '*.h' -o -name '*.cc' -o -name '*.inl')
SOURCES := $(shell find include src scenes cmake assets python -type f -not -path '*/__pycache__/*' 2>/dev/null)
CXX_TESTS := $(shell find tests/cpp -type f 2>/dev/null)
# One build folder serves the package and the C++ tests, so that nothing is compiled twice.
INSTALL = $(BIN)/python -m pip install -q --no-build-isolation -C build-dir=$(BUILD)

.PHONY: run test test-cpp test-python test-arm bench bench-contact sanitize lint format clean
.DELETE_ON_ERROR:
MAKEFLAGS += --no-builtin-rules

run: $(VENV)/installed
	$(BIN)/stickslip paper --output $(OUTPUT) $(PAPER)

test: lint-kernels test-cpp test-python

test-cpp: $(VENV)/installed-test
	$(BIN)/ctest --test-dir $(BUILD) --output-on-failure -j $(CMAKE_BUILD_PARALLEL_LEVEL)

test-python: $(VENV)/installed-test
	$(BIN)/python -m pytest -q

# The environment with the build's own requirements, read from pyproject.toml.
$(VENV)/tools: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || \
	  { echo "Python >= 3.10 is needed; $(PYTHON) is $$($(PYTHON) --version 2>&1). Choose one with: make PYTHON=/path/to/python3"; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || \
	  { echo "This Python cannot make environments: its module ensurepip is missing (Debian and Ubuntu keep it in the package python3-venv). Choose another with: make PYTHON=/path/to/python3"; exit 1; }
	@command -v $${CXX:-c++} >/dev/null || command -v g++ >/dev/null || \
	  { echo "A C++20 compiler is needed (GCC >= 12 or Clang >= 16); set CXX to yours."; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q --upgrade 'pip>=23.1'  # -C needs it; distributions ship older ones
	$(BIN)/python -c 'import ast, re; print(*ast.literal_eval(re.search(r"requires = (\[.*?\n\])", open("pyproject.toml").read(), re.S)[1]), sep="\n")' > $@.txt
	$(BIN)/python -m pip install -q -r $@.txt 'cmake>=3.24' ninja
	touch $@

$(VENV)/installed: $(VENV)/tools $(SOURCES) CMakeLists.txt
	$(INSTALL) -C cmake.define.STICKSLIP_TESTS=OFF .
	touch $@

$(VENV)/installed-test: $(VENV)/tools $(SOURCES) $(CXX_TESTS) CMakeLists.txt
	$(INSTALL) -C cmake.define.STICKSLIP_TESTS=ON '.[test]'
	touch $@ $(VENV)/installed

$(VENV)/dev: $(VENV)/tools
	$(BIN)/python -c 'import ast, re; print(*ast.literal_eval(re.search(r"\ndev = (\[.*?\])", open("pyproject.toml").read(), re.S)[1]), sep="\n")' > $@.txt
	$(BIN)/python -m pip install -q -r $@.txt
	touch $@

# The benchmarks have their own build folder: the package's keeps its options.
$(VENV)/bench: $(VENV)/tools
	$(BIN)/python -c 'import ast, re; print(*ast.literal_eval(re.search(r"\nbench = (\[.*?\])", open("pyproject.toml").read(), re.S)[1]), sep="\n")' > $@.txt
	$(BIN)/python -m pip install -q -r $@.txt
	touch $@

bench: $(VENV)/bench
	$(BIN)/python benchmarks/compare/run.py $(BENCH)

bench-contact: $(VENV)/bench
	$(BIN)/python benchmarks/contact/run.py $(BENCH)

# Whole tasks of worlds, which take long with sanitizers and in emulators; those of batches stay in.
LONG_TESTS := physics_test_(tasks|large_steps)

# -O1: with checks in every unrolled kernel, -O2 takes minutes and gigabytes per file.
sanitize: $(VENV)/tools
	$(BIN)/cmake -S . -B build/sanitize -G Ninja -DCMAKE_MAKE_PROGRAM=$(abspath $(BIN))/ninja -DPython_EXECUTABLE=$(abspath $(BIN))/python \
	  -DCMAKE_BUILD_TYPE=RelWithDebInfo -DCMAKE_CXX_FLAGS_RELWITHDEBINFO='-O1 -g1' -DSTICKSLIP_TESTS=ON -DSTICKSLIP_SANITIZE=ON
	$(BIN)/cmake --build build/sanitize
	$(BIN)/ctest --test-dir build/sanitize --output-on-failure -j $(CMAKE_BUILD_PARALLEL_LEVEL) -E '$(LONG_TESTS)'

.PHONY: arm-tools
arm-tools:
	@command -v aarch64-linux-gnu-g++ >/dev/null && command -v qemu-aarch64 >/dev/null || \
	  { echo "aarch64-linux-gnu-g++ and qemu-aarch64 are needed (Debian and Ubuntu: packages g++-aarch64-linux-gnu, qemu-user)."; exit 1; }

ARM_WHEELS := build/aarch64-wheels
$(ARM_WHEELS)/installed: $(VENV)/tools | arm-tools
	rm -rf $(ARM_WHEELS) && mkdir -p $(ARM_WHEELS)
	grep cmeel $(VENV)/tools.txt > $(ARM_WHEELS)/wanted.txt
	$(BIN)/python -m pip install -q --target $(ARM_WHEELS) --only-binary=:all: \
	  --platform manylinux_2_28_aarch64 --platform manylinux_2_17_aarch64 -r $(ARM_WHEELS)/wanted.txt
	touch $@

# Shows that NEON compiles and has the bits of every other instruction set, on a machine without it. The libraries are ARM's wheels.
test-arm: arm-tools $(ARM_WHEELS)/installed
	$(BIN)/cmake -S . -B build/aarch64 -G Ninja -DCMAKE_MAKE_PROGRAM=$(abspath $(BIN))/ninja -DPython_EXECUTABLE=$(abspath $(BIN))/python \
	  -DCMAKE_TOOLCHAIN_FILE=cmake/aarch64.cmake -DSTICKSLIP_CMEEL_PREFIX=$(abspath $(ARM_WHEELS))/cmeel.prefix \
	  -DSTICKSLIP_TESTS=ON -DSTICKSLIP_WERROR=ON
	$(BIN)/cmake --build build/aarch64
	$(BIN)/ctest --test-dir build/aarch64 --output-on-failure -j $(CMAKE_BUILD_PARALLEL_LEVEL) -E '$(LONG_TESTS)'

.PHONY: lint-kernels
lint-kernels: $(VENV)/tools
	$(BIN)/python tools/lint_kernels.py

lint: $(VENV)/dev lint-kernels
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/clang-format --dry-run -Werror $(CXX_FILES)

format: $(VENV)/dev
	$(BIN)/ruff check --fix-only -q .
	$(BIN)/ruff format .
	$(BIN)/clang-format -i $(CXX_FILES)

clean:
	rm -rf build $(VENV)
