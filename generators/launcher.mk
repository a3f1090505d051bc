# A build's GNUmakefile, which GNU make reads instead of Edalize's Makefile: programs of the build are started by
# firm_launcher.sh unless EDALIZE_LAUNCHER says otherwise.
ifeq ($(origin EDALIZE_LAUNCHER),undefined)
EDALIZE_LAUNCHER := sh firm_launcher.sh
endif

include Makefile
