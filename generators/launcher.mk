# A build's GNUmakefile, which GNU make reads in place of Edalize's Makefile. Programs of the build are started by `firm
# tool` unless EDALIZE_LAUNCHER says otherwise: it finds those of PyPI, names the package of a missing one, and notes
# in manifest.json which one has run.
ifeq ($(origin EDALIZE_LAUNCHER),undefined)
FIRM_PYTHON := $(shell python3 firm_python.py)
ifneq ($(FIRM_PYTHON),)
EDALIZE_LAUNCHER := $(FIRM_PYTHON) -m fusesoc_firm.launcher
endif
endif

include Makefile
