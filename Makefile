# The two commands to start with are `make sim` and `make test`. Each installs what is missing, then does its job.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

VENV := .venv
BIN := $(VENV)/bin

SYSTEM ?= robot:sys:quat2euler
# For make bitstream: a target of SYSTEM.
BOARD ?= ulx3s
FUSESOC_OPTIONS ?=
# The test bench's seed of random stalls; empty is the one of the system's .core.
SEED ?=
# WAVES=1 writes waves.ghw into the build folder and prints its path.
WAVES ?=
# Further options for the simulator.
SIM_OPTIONS ?=
# The system's target: sim, sim_icarus, sim_verilator.
TARGET ?= sim
# Pythons for make matrix, beside those on PATH and pyenv's, such as PYTHONS=/opt/python3.14/bin/python3
PYTHONS ?=
# Programs that a target needs beside those of all.
TOOLS :=
# Edalize's flows that end in a bitstream; what the open ones need from PyPI is an extra of the same name.
OPEN_FLOWS := apicula icestorm trellis
BITSTREAM_FLOWS := $(OPEN_FLOWS) quartus vivado
# Where `make corpus` finds message definitions, in the folders ros1 and ros2, and further options of its command.
CORPUS ?= ../shared/corpus
VERIFY_OPTIONS ?=
# Parts of the bench, all if empty, such as BENCH='area cycles'; BENCH=--help lists them.
BENCH ?=
# Options and pages for make docs, such as DOCS=--update or DOCS=README.md; all pages if none is named.
DOCS ?=
# Options for pytest, such as PYTEST_OPTIONS='-k store -x'.
PYTEST_OPTIONS ?= -n auto --dist loadgroup
# What tests run beside Python.
TEST_TOOLS := ccache iverilog verilator yosys dot:graphviz tclsh:tcl rosbag:python3-rosbag

# With `=`, since the value begins with a dash. FuseSoC adds these to the sim_options of the core, which are GHDL's.
SIM_FLAGS = $(strip $(if $(SEED),-gSEED=$(SEED)) $(if $(WAVES),--wave=waves.ghw) $(SIM_OPTIONS))
# Of a failed run, too.
SAY_WAVES = $(if $(WAVES),trap 'ls -t build/*/sim/waves.ghw | sed -n "1s/^/waves: /p"' EXIT;)
# A host in Verilog takes its seed from FuseSoC.
RUN_FLAGS = $(if $(filter sim,$(TARGET)),$(if $(SIM_FLAGS),--sim_options="$(SIM_FLAGS)"),$(if $(WAVES),$(error WAVES=1 is for GHDL, TARGET=sim))$(if $(SEED),--SEED=$(SEED)) $(SIM_OPTIONS))

# What a node and its peers need of ROS 1, as Debian has it: programs and libraries, and modules of its own Python.
DEBIAN_MODULES := /usr/lib/python3/dist-packages
ROS1 := pkg-config rosmaster:python3-rosmaster /usr/include/ros/ros.h:libroscpp-dev \
  $(foreach name,rospy std_msgs geometry_msgs sensor_msgs,$(DEBIAN_MODULES)/$(name):python3-$(subst _,-,$(name)))

# Designs of make fuzz-netlist, and further options, such as FUZZ_OPTIONS='--judges icarus'.
DESIGNS ?= 10000
FUZZ_OPTIONS ?=

# Install a package: pip install $(2), with the pip of an environment, $(1). With --quiet, pip leaves out why it failed.
pip_install = $(1)/bin/pip install --disable-pip-version-check $(2) >$(1)/pip.log 2>&1 || \
  { cat $(1)/pip.log >&2; echo "pip could not install $(2); its message is above." >&2; exit 1; }

.PHONY: help sim test check docs ros bitstream bench matrix proofs policies corpus fuzz-netlist lint licences setup tools clean distclean

help: ## List the targets
	@echo "Usage: make TARGET [VARIABLE=VALUE ...]"
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

# Without what make and Edalize say about folders, the result is the last line.
sim: $(VENV)/.installed ## Simulate SYSTEM (robot:sys:quat2euler); TARGET=sim_verilator, SEED=N, WAVES=1, SIM_OPTIONS='...'
	@$(BIN)/python .ci/check_target.py $(SYSTEM) $(TARGET) sim >/dev/null
	@./.ci/install-tools $(subst icarus,iverilog,$(patsubst sim_%,%,$(filter sim_%,$(TARGET)))) >/dev/null
	@$(SAY_WAVES) MAKEFLAGS=--no-print-directory PYTHONUNBUFFERED=1 \
	  $(BIN)/fusesoc run --target=$(TARGET) $(SYSTEM) $(RUN_FLAGS) 2>&1 | \
	  sed -u "/^\(Entering\|Leaving\) directory '/d"

test check: TOOLS = $(TEST_TOOLS)
test: setup ros ## Run the tests, every rule once, in ten minutes; PYTEST_OPTIONS='...'
	@$(BIN)/python -m pytest $(PYTEST_OPTIONS)

check: setup ros lint ## Run what takes longer: live ROS, proofs, boards, more sizes and seeds; PYTEST_OPTIONS='...'
	@$(BIN)/python -m pytest -m "check and not thorough" $(PYTEST_OPTIONS)

docs: TOOLS = dot:graphviz
docs: tools $(VENV)/.extra-docs ## Run the commands of the pages, build their site in build/docs; DOCS=--update writes their output into the pages
	@$(BIN)/python -m tests.pages $(DOCS)
	@$(BIN)/zensical build --clean --strict
	@echo "The site: build/docs/index.html"

# Both are there for some of the tests, which are skipped without them.
ros: $(VENV)/.ros2
	@./.ci/install-tools $(ROS1) >/dev/null || echo "No ROS 1: the tests with it are skipped" >&2

HAS_CORPUS := $(and $(wildcard $(CORPUS)/ros1),$(wildcard $(CORPUS)/ros2))

corpus: $(if $(HAS_CORPUS),setup) ## Verify the converters of all messages below CORPUS; VERIFY_OPTIONS='--width 64 ...'
ifeq ($(HAS_CORPUS),)
	@echo "No corpus: '$(CORPUS)' has no folders ros1 and ros2 of message definitions; CORPUS=DIR names another place"
else
	@status=0; mkdir -p build; \
	for ros in 1 2; do \
	  $(BIN)/firm message verify --ros $$ros --path "$(CORPUS)/ros$$ros" \
	    --report build/corpus_ros$$ros.json $(VERIFY_OPTIONS) || status=1; \
	done; exit $$status
endif

bench: TOOLS = iverilog verilator
bench: setup ros $(VENV)/.extra-bench ## Measure area, cycles, robustness and times, write docs/figures; BENCH='area cycles' for parts, BENCH=--help lists them
	@$(BIN)/python -m tests.bench $(BENCH)

# Further options go to the board's target: make bitstream FUSESOC_OPTIONS=--clean
bitstream: $(VENV)/.installed ## Build SYSTEM for BOARD (icebreaker, tangnano9k, ulx3s) to a bitstream
	@flow=$$($(BIN)/python .ci/check_target.py $(SYSTEM) $(BOARD) $(BITSTREAM_FLOWS)); \
	case " $(OPEN_FLOWS) " in \
	  *" $$flow "*) ./.ci/install-tools yosys >/dev/null; $(MAKE) --no-print-directory $(VENV)/.extra-$$flow ;; \
	esac
	@$(BIN)/fusesoc run --setup --build --target=$(BOARD) $(FUSESOC_OPTIONS) $(SYSTEM)

matrix: TOOLS = verilator
matrix: tools $(VENV)/.extra-matrix ## Try each supported Python with the oldest and newest packages; PYTHONS='PYTHON ...' names more
	@$(BIN)/python -m tests.matrix $(PYTHONS)

proofs: setup ## Prove the Manager and the schedulers, write docs/figures/proofs.md
	@$(BIN)/python -m tests.proofs

policies: $(VENV)/.installed ## Write the lists of schedulers in cores/sched from fusesoc_firm/scheduling/policies.py
	@$(BIN)/python -m tests.cores.policies

fuzz-netlist: TOOLS = iverilog verilator
fuzz-netlist: setup ## Compare the netlists of random designs with GHDL's simulation; SEED=N, DESIGNS=10000, FUZZ_OPTIONS='--judges icarus'
	@$(BIN)/python -m tests.netlist --designs $(DESIGNS) $(if $(SEED),--seed $(SEED)) $(FUZZ_OPTIONS)

lint: setup $(VENV)/.extra-lint ## Check style and types: Python, and VHDL, also a sample of what is generated
	@$(BIN)/ruff check .
	@$(BIN)/mypy
	@$(BIN)/python .ci/lint_vhdl.py

# All extras, since all are listed.
licences: $(addprefix $(VENV)/.extra-,$(shell awk '/^\[/ { inside = /optional-dependencies/ } inside && /^[a-z]+ = / { print $$1 }' pyproject.toml))
licences: TOOLS = $(TEST_TOOLS)
licences: tools ros ## List what the project depends on and under which licences, in docs/reference/licences.md
	@$(BIN)/python .ci/licences.py $(VENV)/ros2/bin/python

setup: tools $(VENV)/.extra-test ## Install what the other targets need: programs by apt, Python packages into .venv

tools:
	@./.ci/install-tools $(TOOLS) >/dev/null

# Installed again when the dependencies change. FUSESOC_IGNORE: no folder of ours but the library is to be searched for
# cores, even if somebody adds the whole checkout.
$(VENV)/.installed: pyproject.toml | tools
	@test -x $(BIN)/pip || "$$(./.ci/install-tools)" -m venv --clear $(VENV)
	@touch $(VENV)/FUSESOC_IGNORE
	@echo "Installing Python packages into $(VENV)"
	@$(call pip_install,$(VENV),--editable .)
	@touch $@

# What a target needs beside: an extra of pyproject.toml.
$(VENV)/.extra-%: $(VENV)/.installed
	@echo "Installing Python packages for '$*' into $(VENV)"
	@$(call pip_install,$(VENV),--editable '.[$*]')
	@touch $@

# ROS 2 as wheels, and the libpython that some of their libraries expect in the process. They have a venv of their own, as
# they fill it with libraries and headers.
$(VENV)/.ros2: tests/ros/ros2.txt $(VENV)/.installed
	@echo "Installing ROS 2 into $(VENV)/ros2"
	@python=$$(./.ci/install-tools) && "$$python" -m venv --clear $(VENV)/ros2 && \
	  ./.ci/install-tools $$("$$python" -c 'from sys import version_info as v; from ctypes.util import find_library as f; \
	    name = f"python{v[0]}.{v[1]}"; print("" if f(name) else f"lib{name}")') >/dev/null && \
	  $(VENV)/ros2/bin/pip install --quiet --disable-pip-version-check --requirement $< && touch $@ || \
	  echo "No ROS 2: the tests with it are skipped" >&2

clean: ## Remove what was built; .venv stays
	@find build -mindepth 1 -maxdepth 1 ! -name FUSESOC_IGNORE -exec rm -rf {} +
	@rm -rf dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis

distclean: clean ## Remove .venv too
	@rm -rf $(VENV)
