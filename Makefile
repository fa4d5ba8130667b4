# twopass: build, test, install. See README.md.
#
#   make            programs and libcommon.a in build/
#   make demo       install what is missing, build, render the Cornell box
#   make check      install what is missing, build, run all tests
#   make check T=lobe    the tests of one program or file, T=lobe:energy some of them
#   make check-fast      those that take no more than seconds; installs nothing
#   make check SAN=1     the same under ASan and UBSan, in build-san/
#   make report     speed and accuracy, measured: build/report/index.html

VERSION := 0.1.0
CC ?= gcc
CXX ?= g++
ifeq ($(origin CC),default)
CC := gcc
endif
PYTHON ?= /usr/bin/python3
PREFIX ?= /usr/local
DESTDIR ?=

# The one list of Debian packages: what is built with, tested with, plotted with.
PACKAGES := gcc g++ make pkg-config libembree-dev libopenexr-dev libtinygltf-dev \
	libjansson-dev libxxhash-dev libpng-dev libcmocka-dev python3 python3-numpy \
	mandoc perl gnuplot-nox

BUILD ?= build$(if $(SAN),-san)
OPT ?= -O2 -march=x86-64-v3
, := ,
SANFLAGS := $(if $(SAN),-fsanitize=address$(,)undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer)
WARN := -Wall -Wextra -Wpedantic -Wshadow -Wconversion
EXR_CFLAGS := $(shell pkg-config --cflags OpenEXR 2>/dev/null)
CPPFLAGS += -I. -D_POSIX_C_SOURCE=200809L -D_FILE_OFFSET_BITS=64 -DTWOPASS_VERSION='"$(VERSION)"' -MMD -MP $(EXR_CFLAGS)
CFLAGS += -std=c11 $(OPT) -g -pthread -ffp-contract=off $(WARN) $(SANFLAGS)
CXXFLAGS += -std=c++17 $(OPT) -g -pthread $(WARN) $(SANFLAGS)
LDFLAGS += -pthread $(SANFLAGS)
LDLIBS := -lembree3 -lOpenEXRCore-3_1 -ltinygltf -ljansson -lxxhash -lpng -lstdc++ -lm

TOOLS := mesh ffcalc shoot trace reference inspect exrcmp tone
KEYED := mesh ffcalc shoot trace reference
PROGRAMS := $(TOOLS:%=$(BUILD)/%)
LIB_OBJS := $(patsubst %.c,$(BUILD)/%.o,$(wildcard lib/*/*.c formats/*/*.c)) \
	$(patsubst %.cc,$(BUILD)/%.o,$(wildcard formats/*/*.cc))
CLI_OBJS := $(patsubst %.c,$(BUILD)/%.o,$(wildcard tools/common/*.c))
UNIT_SOURCES := $(wildcard tests/unit/test_*.c tests/unit/*/test_*.c)
UNIT_TESTS := $(patsubst %.c,$(BUILD)/tests/%,$(notdir $(UNIT_SOURCES)))
BENCHES := $(patsubst tests/bench/%.c,$(BUILD)/bench/%,$(wildcard tests/bench/*.c))

all: $(PROGRAMS) $(BUILD)/libcommon.a

$(BUILD)/libcommon.a: $(LIB_OBJS)
	@rm -f $@
	ar rcs $@ $^

$(BUILD)/libcli.a: $(CLI_OBJS)
	@rm -f $@
	ar rcs $@ $^

$(PROGRAMS): $(BUILD)/%: $(BUILD)/tools/%.o $(BUILD)/libcli.a $(BUILD)/libcommon.a
	$(CC) $(LDFLAGS) -o $@ $^ $(LDLIBS)

# Programs whose outputs have keys know a digest of the sources that the linker says they are
# made of.
$(KEYED:%=$(BUILD)/%): $(BUILD)/%: $(BUILD)/code/%.o
$(BUILD)/code/%.c: $(BUILD)/tools/%.o $(BUILD)/libcli.a $(BUILD)/libcommon.a tools/code_digest.pl
	@mkdir -p $(@D)
	@$(CC) $(LDFLAGS) -no-pie -s -Wl,-t,-t,--unresolved-symbols=ignore-all -o $(@:.c=.link) \
		$(filter-out %.pl,$^) $(LDLIBS) | perl tools/code_digest.pl $(BUILD) $* >$@.new
	@rm $(@:.c=.link); mv $@.new $@

$(BUILD)/code/%.o: $(BUILD)/code/%.c
	$(CC) $(CPPFLAGS) $(CFLAGS) -c -o $@ $<

$(foreach c,$(UNIT_SOURCES),$(eval $(BUILD)/tests/$(basename $(notdir $c)): $(BUILD)/$(c:.c=.o)))
$(UNIT_TESTS): $(BUILD)/libcommon.a
	@mkdir -p $(@D)
	$(CC) $(LDFLAGS) -o $@ $(filter %.o,$^) $(filter %.a,$^) $(LDLIBS) -lcmocka

$(BENCHES): $(BUILD)/bench/%: $(BUILD)/tests/bench/%.o $(BUILD)/libcommon.a
	@mkdir -p $(@D)
	$(CC) $(LDFLAGS) -o $@ $^ $(LDLIBS)

$(BUILD)/%.o: %.c
	@mkdir -p $(@D)
	$(CC) $(CPPFLAGS) $(CFLAGS) -c -o $@ $<

# Loops written to become vector code.
FAST := hemicube/hemicube_render ff_rays/ray_samples geometry/cubature_pair geometry/exchange_unoccluded geometry/cubature occlusion/exchange \
	occlusion/shadow_edges occlusion/occluder occlusion/visible_region occlusion/shaft geometry/point_polygon \
	geometry/facet ff/exchange_matrix ff_tally/ff_batch interpolate/reconstruct interpolate/reconstruct_fit \
	radiosity/propagate radiosity/truncation_bound radiosity/shoot radiosity/element_irradiance radiosity/gmres
$(FAST:%=$(BUILD)/lib/%.o): CFLAGS += -O3 -fno-math-errno -fno-trapping-math

# tinygltf and nlohmann's header are not ours to hold to our warnings.
$(BUILD)/%.o: %.cc
	@mkdir -p $(@D)
	$(CXX) $(CPPFLAGS) $(CXXFLAGS) -c -o $@ $<

unit: $(UNIT_TESTS)

# ---- the machine ----

# Installs the packages that are not there yet (root, or sudo).
deps:
	@missing=; for p in $(PACKAGES); do \
		dpkg-query -W -f '$${Status}' $$p 2>/dev/null | grep -q 'ok installed' || missing="$$missing $$p"; \
	done; \
	if [ -n "$$missing" ]; then \
		echo "installing:$$missing"; \
		sudo=; [ "$$(id -u)" = 0 ] || sudo=sudo; \
		$$sudo apt-get update -qq && \
		DEBIAN_FRONTEND=noninteractive $$sudo apt-get install -y -qq --no-install-recommends $$missing; \
	fi

# ---- the demo: a new make, so that it sees packages just installed ----

demo: deps
	@$(MAKE) --no-print-directory -j2 all
	@MAKE='$(MAKE)' scenes/demo.sh $(BUILD) out

# ---- tests ----

# A slow test says so itself: a line `# tier: slow` in its file, slow_unit_test() in C.
CHECKS := $(sort $(wildcard tests/tools/*.t tests/tools/*.py))
TESTS := $(UNIT_TESTS) $(CHECKS)
RUN = BUILD=$(abspath $(BUILD)) PYTHON=$(PYTHON) ONLY='$(ONLY)' tests/run.pl -j 2

ifneq ($(origin T),command line)
check: deps
	@$(MAKE) --no-print-directory -j2 all unit
	@$(MAKE) --no-print-directory check-layers check-man
	@$(RUN) $(TESTS)
else
# T=lobe: programs whose name contains it; T=lobe:energy: their tests whose name contains that.
FILE := $(firstword $(subst :, ,$(T)))
ONLY := $(if $(findstring :,$(T)),$(subst $(FILE):,,$(T)))
WANTED := $(foreach t,$(TESTS),$(if $(findstring $(FILE),$(notdir $t)),$t))
check:
	@[ -n '$(WANTED)' ] || { echo 'no test is called *$(FILE)*'; exit 1; }
	@$(MAKE) --no-print-directory -j2 $(filter $(BUILD)/%,$(WANTED)) $(if $(filter tests/%,$(WANTED)),all)
	@$(RUN) $(WANTED)
endif

# What takes 30 CPU seconds, installs nothing and needs no network.
check-fast:
	@$(MAKE) --no-print-directory -j2 all unit
	@$(MAKE) --no-print-directory check-layers check-man
	@FAST=1 $(RUN) $(filter-out $(shell grep -l '^# tier: slow' $(CHECKS)),$(TESTS))

# Arrows point down only: tools -> formats -> lib, and lib knows no files.
check-layers:
	@$(PYTHON) tests/check_layers.py

check-man:
	@bad=$$(for p in man/*.[1-9]; do mandoc -T lint -W warning $$p; done); [ -z "$$bad" ] || { echo "$$bad"; exit 1; }
	@echo "manual pages: ok"

# What the methods make of every exact answer we have.
oracles: all
	BUILD=$(abspath $(BUILD)) $(PYTHON) tests/exact/oracles.py --all --jobs $$(nproc)

bench: all $(BENCHES)
	BUILD=$(abspath $(BUILD)) sh tests/bench/run.sh

# One page of all that is measured, in less than 20 minutes; FULL=1: more, in hours. Its
# tables and its plot go into RESULTS.md and README.md, too.
REPORT := BUILD='$(abspath $(BUILD))' CC='$(CC)' OPT='$(OPT)' PYTHON='$(PYTHON)' \
	$(PYTHON) tests/bench/report $(if $(FULL),--full) --into tests/bench/RESULTS.md --into README.md --out
report: all $(BUILD)/bench/rays $(BUILD)/bench/pairs
	@$(REPORT) $(BUILD)/report
	cp $(BUILD)/report/speed.png scenes/pictures/speed.png

# What takes minutes a row and so is not in it.
report-long: all
	@$(REPORT) $(BUILD)/report-long --only speed-long

# What RESULTS.md says of form factors between patches, to be put there by hand.
bench-form-factors: all $(BUILD)/bench/rays
	BUILD=$(abspath $(BUILD)) $(PYTHON) tests/bench/form_factors.py --tuned

# Lines that were changed since the last commit, as .clang-format has it. The rest is written by
# hand: the tool would break tables and lists of one line, or join what was broken for sense.
format:
	git clang-format --extensions c,h,cc HEAD

# For clangd and its like.
compile_commands.json: Makefile
	@$(MAKE) -nB all unit $(BENCHES) | $(PYTHON) -c 'import json, os, re, sys; json.dump([ \
		{"directory": os.getcwd(), "command": line.strip(), "file": line.split()[-1]} \
		for line in sys.stdin if re.search(r" -c -o \S+ \S+$$", line)], sys.stdout, indent=1)' >$@

# ---- installation ----

DEST = $(DESTDIR)$(PREFIX)

# The library as it is installed: one object that shows twopass_* to linkers and nothing
# else, so that no name of ours meets one of a user's program. COMDAT groups are dissolved
# first, or a program's inline function of the same name would take their place.
API_OBJS := $(patsubst %.c,$(BUILD)/%.o,$(wildcard formats/api/*.c))
$(BUILD)/dist/libcommon.a: $(API_OBJS) $(BUILD)/libcommon.a
	@mkdir -p $(@D)
	ld -r --force-group-allocation -o $(@D)/twopass.o $^
	objcopy --wildcard --keep-global-symbol='twopass_*' $(@D)/twopass.o
	@rm -f $@
	ar rcs $@ $(@D)/twopass.o

define LIBCOMMON_PC
prefix=$(PREFIX)
includedir=$${prefix}/include
libdir=$${prefix}/lib

Name: libcommon
Description: global illumination, form factors and pictures of a scene (twopass)
Version: $(VERSION)
Cflags: -I$${includedir}
Libs: -L$${libdir} -lcommon $(LDLIBS) -pthread $(SANFLAGS)
endef
export LIBCOMMON_PC

install: all $(BUILD)/dist/libcommon.a
	install -d $(DEST)/bin $(DEST)/include $(DEST)/lib/pkgconfig $(DEST)/share/twopass
	install -m 755 $(PROGRAMS) $(DEST)/bin
	install -m 644 formats/api/twopass.h $(DEST)/include
	install -m 644 $(BUILD)/dist/libcommon.a $(DEST)/lib
	echo "$$LIBCOMMON_PC" >$(DEST)/lib/pkgconfig/libcommon.pc
	install -m 644 tools/pipeline.mk $(DEST)/share/twopass
	for p in man/*.[1-9]; do install -D -m 644 -t $(DEST)/share/man/man$${p##*.} $$p; done

uninstall:
	rm -f $(TOOLS:%=$(DEST)/bin/%) $(DEST)/include/twopass.h $(DEST)/lib/libcommon.a \
		$(DEST)/lib/pkgconfig/libcommon.pc $(DEST)/share/twopass/pipeline.mk
	for p in $(notdir $(wildcard man/*.[1-9])); do rm -f $(DEST)/share/man/man$${p##*.}/$$p; done
	[ ! -d $(DEST)/share/twopass ] || rmdir --ignore-fail-on-non-empty $(DEST)/share/twopass

clean:
	rm -rf build build-san out compile_commands.json

.PHONY: all unit deps demo check check-fast check-layers check-man oracles bench report report-long \
	bench-form-factors format install uninstall clean
.SECONDARY:
-include $(shell find $(BUILD) -name '*.d' 2>/dev/null)
