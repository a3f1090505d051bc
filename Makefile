# The two commands to start with are `make sim` and `make test`. Each installs what is missing, then does its job.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

VENV := .venv
BIN := $(VENV)/bin

SYSTEM ?= robot:sys:quat2euler
# The test bench's seed of random stalls; empty is the one of the system's .core.
SEED ?=
# WAVES=1 writes waves.ghw into the build folder.
WAVES ?=
# Further options for the simulator.
SIM_OPTIONS ?=
# Programs that a target needs beside those of all.
TOOLS :=
# Where `make corpus` finds message definitions, in the folders ros1 and ros2, and further options of its command.
CORPUS ?= ../shared/corpus
VERIFY_OPTIONS ?=
# Parts of the bench, all if empty: BENCH='area manager timing use cycles fuzz images systems'.
BENCH ?=
# Options for pytest, such as PYTEST_OPTIONS='-k store -x'.
PYTEST_OPTIONS ?= -n auto --dist loadgroup

# With `=`, since the value begins with a dash. FuseSoC adds these to the sim_options of the core.
SIM_FLAGS = $(strip $(if $(SEED),-gSEED=$(SEED)) $(if $(WAVES),--wave=waves.ghw) $(SIM_OPTIONS))

.PHONY: help sim test bench proofs corpus lint setup tools clean distclean

help: ## List the targets
	@echo "Usage: make TARGET [VARIABLE=VALUE ...]"
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

# Without what make and Edalize say about folders, the result is the last line.
sim: setup ## Simulate SYSTEM (robot:sys:quat2euler); SEED=N, WAVES=1, SIM_OPTIONS='...'
	@MAKEFLAGS=--no-print-directory PYTHONUNBUFFERED=1 \
	  $(BIN)/fusesoc run --target=sim $(SYSTEM) $(if $(SIM_FLAGS),--sim_options="$(SIM_FLAGS)") 2>&1 | \
	  sed -u "/^\(Entering\|Leaving\) directory '/d"

test: TOOLS = iverilog verilator dot:graphviz
test: setup ## Run all tests; PYTEST_OPTIONS='...'
	@$(BIN)/python -m pytest $(PYTEST_OPTIONS)

HAS_CORPUS := $(and $(wildcard $(CORPUS)/ros1),$(wildcard $(CORPUS)/ros2))

corpus: $(if $(HAS_CORPUS),setup) ## Verify the converters of all messages below CORPUS; VERIFY_OPTIONS='--width 64 ...'
ifeq ($(HAS_CORPUS),)
	@echo "No corpus: '$(CORPUS)' has no folders ros1 and ros2 of message definitions; CORPUS=DIR names another place"
else
	@status=0; \
	for ros in 1 2; do \
	  $(BIN)/firm message verify --ros $$ros --path "$(CORPUS)/ros$$ros" \
	    --report build/corpus_ros$$ros.json $(VERIFY_OPTIONS) || status=1; \
	done; exit $$status
endif

bench: TOOLS = verilator
bench: setup $(VENV)/.bench ## Measure area, cycles and robustness, write docs/figures.md; BENCH='area manager timing use cycles fuzz images systems'
	@$(BIN)/python -m tests.bench $(BENCH)

proofs: setup ## Prove the Manager and the schedulers, write docs/proofs.md
	@$(BIN)/python -m tests.proofs

lint: setup ## Check style and types
	@$(BIN)/ruff check .
	@$(BIN)/mypy

setup: tools $(VENV)/.installed ## Install what the other targets need: programs by apt, Python packages into .venv

tools:
	@./.ci/install-tools $(TOOLS) >/dev/null

# Installed anew when the dependencies change. FUSESOC_IGNORE: no folder of ours but the library is to be searched for
# cores, even if somebody adds the whole checkout.
$(VENV)/.installed: pyproject.toml | tools
	@test -x $(BIN)/pip || "$$(./.ci/install-tools)" -m venv --clear $(VENV)
	@touch $(VENV)/FUSESOC_IGNORE
	@echo "Installing Python packages into $(VENV)"
	@$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[test]' || \
	  { echo "pip could not install what pyproject.toml lists; its message is above." >&2; exit 1; }
	@touch $@

# Yosys is there for the proofs; nextpnr is for the bench alone.
$(VENV)/.bench: $(VENV)/.installed
	@echo "Installing nextpnr into $(VENV)"
	@$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[bench]'
	@touch $@

clean: ## Remove what was built; .venv stays
	@find build -mindepth 1 -maxdepth 1 ! -name FUSESOC_IGNORE -exec rm -rf {} +
	@rm -rf dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis

distclean: clean ## Remove .venv too
	@rm -rf $(VENV)
