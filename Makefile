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
# The seed of the test bench's random stalls; if empty, the seed in the system's .core applies.
SEED ?=
# WAVES=1 writes waves.ghw into the build folder and prints its path.
WAVES ?=
# Further options for the simulator.
SIM_OPTIONS ?=
# The system's target: sim, sim_icarus, sim_verilator.
TARGET ?= sim
# Pythons for make matrix, in addition to those on PATH and pyenv's, such as PYTHONS=/opt/python3.14/bin/python3
PYTHONS ?=
# Programs that a target needs in addition to the common ones.
TOOLS :=
# Edalize's flows that end in a bitstream; the PyPI packages of each open one are an extra of the same name.
OPEN_FLOWS := apicula gatemate icestorm machxo2 nexus trellis
BITSTREAM_FLOWS := $(OPEN_FLOWS) quartus vivado
# The folder of message definitions for `make corpus`, with folders ros1 and ros2, and further options of its command.
CORPUS ?=
VERIFY_OPTIONS ?=
# Parts of the bench, such as BENCH='area cycles'; if empty, all run. BENCH=--help lists them.
BENCH ?=
# Options and pages for make pages, such as PAGES=--update or PAGES=README.md; without pages, all are processed.
PAGES ?=
# The suite and the commands, separated by semicolons, of make debian, such as COMMANDS='make sim; .ci/run'
SUITE ?= trixie
COMMANDS ?= make sim; make test
# Options for pytest, such as PYTEST_OPTIONS='-k store -x'.
PYTEST_OPTIONS ?= -n auto --dist loadgroup
# SINCE=REV runs only tests that the changes since a commit can reach; FRESH=1 recalls no result of a tool.
SINCE ?=
FRESH ?=
# Programs other than Python that tests run.
EMULATION_TOOLS := qemu-system-arm arm-none-eabi-gcc:gcc-arm-none-eabi \
  /usr/lib/arm-none-eabi/include/string.h:libnewlib-arm-none-eabi \
  qemu-arm:qemu-user $(foreach triple,arm-linux-gnueabihf aarch64-linux-gnu,$(triple)-g++:g++-$(triple))
STUDIO_TOOLS := chromium
NETWORK_TOOLS := busybox dnsmasq:dnsmasq-base ip:iproute2 tshark
TEST_TOOLS := bwrap:bubblewrap ccache fdtoverlay:device-tree-compiler iverilog strace verilator yosys dot:graphviz \
  tclsh:tcl rosbag:python3-rosbag

SIM_FLAGS = $(if $(filter sim_%,$(TARGET)),--tool $(patsubst sim_%,%,$(TARGET))) $(if $(SEED),--seed $(SEED)) \
  $(if $(WAVES),--waves) $(if $(SIM_OPTIONS),--options="$(SIM_OPTIONS)")

# ROS 1 for a node and its peers, from Debian: programs, libraries, and modules of Debian's own Python.
DEBIAN_MODULES := /usr/lib/python3/dist-packages
ROS1 := pkg-config rosmaster:python3-rosmaster roslaunch:python3-roslaunch \
  rosnode:python3-rosnode rostopic:python3-rostopic /usr/include/ros/ros.h:libroscpp-dev \
  /usr/include/actionlib/client/simple_action_client.h:libactionlib-dev \
  $(foreach name,rospy std_msgs geometry_msgs sensor_msgs actionlib,$(DEBIAN_MODULES)/$(name):python3-$(subst _,-,$(name)))

PYTEST = $(BIN)/python -m pytest $(if $(SINCE),--since "$(SINCE)") $(if $(FRESH),--fresh) $(PYTEST_OPTIONS)

# The campaigns and options of make fuzz
FUZZ ?=
# The number of designs for make fuzz-netlist, and further options, such as FUZZ_OPTIONS='--judges icarus'.
DESIGNS ?= 10000
FUZZ_OPTIONS ?=
# The number of mutants for make mutants, chosen at random (all if empty), and further options, such as parts of paths.
SAMPLE ?=
MUTANTS ?=

# Install a package: pip install $(2), with the pip of an environment, $(1). With --quiet, pip would hide error messages.
pip_install = ./.ci/with-progress $(1)/pip.log $(1)/bin/pip install --disable-pip-version-check $(2) || \
  { cat $(1)/pip.log >&2; echo "pip could not install $(2); see the message above." >&2; \
    ! grep -q "Retrying (" $(1)/pip.log || echo "The package index cannot be reached. Run make again with a network, and with a proxy if one is needed." >&2; \
    exit 1; }

# The user's configuration of git is not changed. The top level of a repository has an empty prefix.
offer_hook = prefix=$$(git rev-parse --show-prefix 2>/dev/null) && [ -z "$$prefix" ] && \
  [ "$$(git config core.hooksPath)" != .ci/hooks ] && \
  echo "To check the messages of your commits, enable the hook: git config core.hooksPath .ci/hooks" || true

.PHONY: help sim test check ci docs pages studio ros kilted bitstream bench matrix proofs dissertation policies constants mutants corpus fuzz fuzz-netlist debian lint licences setup tools clean distclean

help: ## List the targets
	@echo "Usage: make TARGET [VARIABLE=VALUE ...]"
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

sim: $(VENV)/.installed ## Simulate SYSTEM (robot:sys:quat2euler); TARGET=sim_verilator, SEED=N, WAVES=1, SIM_OPTIONS='...'
	@$(BIN)/python .ci/check_target.py $(SYSTEM) $(TARGET) sim >/dev/null
	@./.ci/install-tools $(subst icarus,iverilog,$(patsubst sim_%,%,$(filter sim_%,$(TARGET)))) >/dev/null
	@$(BIN)/firm sim $(SYSTEM) $(SIM_FLAGS)

test: TOOLS = $(TEST_TOOLS)
check ci: TOOLS = $(TEST_TOOLS) $(EMULATION_TOOLS) $(STUDIO_TOOLS) $(NETWORK_TOOLS)
test: setup ros ## Run the tests, every rule once; SINCE=REV, FRESH=1, PYTEST_OPTIONS='...'
	@$(PYTEST)

check: setup ros studio $(VENV)/.extra-lint ## Run the longer tests: live ROS, proofs, boards, more sizes and seeds; variables as for test
	@$(PYTEST) -m "check and not thorough"

ci: setup ros studio $(VENV)/.extra-lint ## Run the tests of test and check together, as continuous integration does; variables as for test
	@$(PYTEST) -m "not thorough"

docs: tools $(VENV)/.extra-docs ## Build the site of the documentation in build/docs
	@$(BIN)/python -m tools.pages.stage
	@cp docs/zensical.toml build
	@$(BIN)/zensical build --clean --strict --config-file build/zensical.toml
	@echo "The site: build/docs/index.html"

pages: TOOLS = dot:graphviz
pages: tools $(VENV)/.extra-docs ## Run the commands in the documentation; PAGES=--update updates their output, PAGES=--install begins with an installation
	@$(BIN)/python -m tools.pages $(PAGES)

studio: $(VENV)/.extra-page ## Build the page of firm studio
	@cd fusesoc_firm/studio/page && export PATH="$(CURDIR)/$(BIN):$$PATH" && \
	  npm ci --silent --no-audit --no-fund && npm run --silent build

kilted: setup $(VENV)/.ros2_kilted ## Run the live tests of nodes, on hosts and in fabric, with ROS 2 Kilted
	@FIRM_ROS2="$(VENV)/ros2_kilted" $(PYTEST) -m "not thorough" -k "not ros1" tests/ros tests/fabric

# Some tests need both, and are skipped without them.
ros: $(VENV)/.ros2
	@./.ci/install-tools $(ROS1) >/dev/null || echo "ROS 1 is missing: tests that need it are skipped" >&2

HAS_CORPUS := $(and $(CORPUS),$(wildcard $(CORPUS)/ros1),$(wildcard $(CORPUS)/ros2))

corpus: $(if $(HAS_CORPUS),setup) ## Verify the converters of all messages below CORPUS; VERIFY_OPTIONS='--width 64 ...'
ifeq ($(HAS_CORPUS),)
	@echo "No corpus: '$(CORPUS)' does not contain the folders ros1 and ros2 with message definitions; set CORPUS=DIR"
else
	@status=0; mkdir -p build; \
	for ros in 1 2; do \
	  $(BIN)/firm message verify --ros $$ros --path "$(CORPUS)/ros$$ros" \
	    --report build/corpus_ros$$ros.json $(VERIFY_OPTIONS) || status=1; \
	done; exit $$status
endif

bench: TOOLS = iverilog verilator yosys $(STUDIO_TOOLS)
bench: setup ros studio $(VENV)/.extra-bench ## Measure area, cycles, robustness and times, write docs/figures; BENCH='area cycles' for parts, BENCH=--help lists them
	@$(BIN)/python -m tools.bench $(BENCH)

# Further options go to the board's target: make bitstream FUSESOC_OPTIONS=--clean
bitstream: $(VENV)/.installed ## Build SYSTEM for BOARD (ulx3s, icebreaker, tangnano9k, ...) to a bitstream
	@flow=$$($(BIN)/python .ci/check_target.py $(SYSTEM) $(BOARD) $(BITSTREAM_FLOWS)); \
	case " $(OPEN_FLOWS) " in \
	  *" $$flow "*) ./.ci/install-tools yosys >/dev/null; $(MAKE) --no-print-directory $(VENV)/.extra-$$flow ;; \
	esac
	@$(BIN)/fusesoc run --setup --build --target=$(BOARD) $(FUSESOC_OPTIONS) $(SYSTEM)

matrix: TOOLS = verilator
matrix: tools $(VENV)/.extra-matrix ## Test each supported Python with the oldest and newest packages; PYTHONS='PYTHON ...' adds more
	@$(BIN)/python -m tools.matrix $(PYTHONS)

proofs: TOOLS = yosys
proofs: setup ## Prove the Manager, the schedulers, and readers, packets and frames of nodes in fabric; write docs/figures/proofs.md
	@$(BIN)/python -m tools.proofs

dissertation: $(VENV)/.extra-test ## Reproduce tables and figures of the dissertation in build/dissertation; pictures need matplotlib
	@$(BIN)/python -m tools.dissertation --dataset all --output build/dissertation

policies: $(VENV)/.installed ## Write the lists of schedulers in cores/sched from fusesoc_firm/scheduling/policies.py
	@$(BIN)/python -m tools.policies

constants: $(VENV)/.installed ## Write the constants of C, C++ and VHDL that derive from Python: codes of faults, numbers of RTPS
	@$(BIN)/python -m tools.constants

fuzz: TOOLS = $(TEST_TOOLS) $(NETWORK_TOOLS)
fuzz: setup ros ## Run the random tests with new seeds, for an hour; FUZZ='bags packets --minutes 20', FUZZ=--help lists the campaigns
	@$(BIN)/python -m tools.fuzz $(FUZZ)

fuzz-netlist: TOOLS = iverilog verilator yosys
fuzz-netlist: setup ## Compare the netlists of random designs with GHDL's simulation; SEED=N, DESIGNS=10000, FUZZ_OPTIONS='--judges icarus'
	@$(BIN)/python -m tools.fuzz_netlist --designs $(DESIGNS) $(if $(SEED),--seed $(SEED)) $(FUZZ_OPTIONS)

mutants: TOOLS = $(TEST_TOOLS) $(EMULATION_TOOLS) $(STUDIO_TOOLS) $(NETWORK_TOOLS)
mutants: setup ros ## Put faults of one line into the sources, each of which the tests must find; SAMPLE=N, SEED=N, MUTANTS='fusesoc_firm/node'
	@$(BIN)/python -m tools.mutants $(if $(SAMPLE),--sample $(SAMPLE)) $(if $(SEED),--seed $(SEED)) $(MUTANTS)

debian: ## Run the README's commands in a minimal system of a suite, as root; SUITE=trixie, bookworm, forky; COMMANDS='make sim; .ci/run'
	@python=$$(./.ci/install-tools debootstrap unshare:util-linux git) && "$$python" .ci/debian.py "$(SUITE)" "$(COMMANDS)"

lint: setup $(VENV)/.extra-lint ## Check style and types of Python and VHDL, including a sample of generated VHDL
	@$(BIN)/ruff check .
	@$(BIN)/mypy
	@$(BIN)/python .ci/lint_vhdl.py

# All extras, since all of them are listed.
licences: $(addprefix $(VENV)/.extra-,$(shell awk '/^\[/ { inside = /optional-dependencies/ } inside && /^[a-z]+ = / { print $$1 }' pyproject.toml))
licences: TOOLS = $(TEST_TOOLS) $(EMULATION_TOOLS) $(STUDIO_TOOLS) $(NETWORK_TOOLS)
licences: tools ros ## List the project's dependencies and their licences in docs/reference/licences.md
	@$(BIN)/python .ci/licences.py $(VENV)/ros2/bin/python

setup: tools $(VENV)/.extra-test ## Install the programs (with apt) and Python packages (into .venv) that other targets need
	@$(if $(filter $@,$(MAKECMDGOALS)),$(offer_hook))

tools:
	@./.ci/install-tools $(TOOLS) >/dev/null

# Installed again when the dependencies change. FUSESOC_IGNORE: even if a user adds the whole checkout, FuseSoC must
# search only the library for cores.
$(VENV)/.installed: pyproject.toml | tools
	@test -x $(BIN)/pip || "$$(./.ci/install-tools)" -m venv --clear $(VENV)
	@touch $(VENV)/FUSESOC_IGNORE
	@echo "Installing Python packages into $(VENV)"
	@$(call pip_install,$(VENV),--editable .)
	@touch $@

# A target's further dependencies: an extra of pyproject.toml.
$(VENV)/.extra-%: $(VENV)/.installed
	@echo "Installing Python packages for '$*' into $(VENV)"
	@$(call pip_install,$(VENV),--editable '.[$*]')
	@touch $@

# ROS 2 as wheels; they have a venv of their own, since they fill it with libraries and headers.
$(VENV)/.ros2: tests/ros/ros2.txt $(VENV)/.installed
	@echo "Installing ROS 2 into $(VENV)/ros2"
	@./.ci/install-ros2 $(VENV)/ros2 $< && touch $@ || echo "ROS 2 is missing: tests that need it are skipped" >&2

$(VENV)/.ros2_kilted: tests/ros/ros2_kilted.txt $(VENV)/.installed
	@echo "Installing ROS 2 Kilted into $(VENV)/ros2_kilted"
	@./.ci/install-ros2 $(VENV)/ros2_kilted $< && touch $@

clean: ## Remove everything that was built, except .venv
	@find build -mindepth 1 -maxdepth 1 ! -name FUSESOC_IGNORE -exec rm -rf {} +
	@rm -rf dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis

distclean: clean ## Remove .venv too
	@rm -rf $(VENV)
