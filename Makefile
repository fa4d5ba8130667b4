# twopass: build, test, install. See README.md.
#
#   make            programs and libcommon.a in build/
#   make demo       install what is missing, build, render the Cornell box
#   make check      install what is missing, build, run all tests
#   make check SAN=1  the same under ASan and UBSan, in build-san/

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
SANFLAGS := $(if $(SAN),-fsanitize=address$(,)undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer)
, := ,
SANFLAGS := $(if $(SAN),-fsanitize=address$(,)undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer)
WARN := -Wall -Wextra -Wpedantic -Wshadow -Wconversion
EXR_CFLAGS := $(shell pkg-config --cflags OpenEXR 2>/dev/null)
CPPFLAGS += -D_POSIX_C_SOURCE=200809L -D_FILE_OFFSET_BITS=64 -MMD -MP $(EXR_CFLAGS)
CFLAGS += -std=c11 $(OPT) -g -pthread -ffp-contract=off $(WARN) $(SANFLAGS)
CXXFLAGS += -std=c++17 $(OPT) -g -pthread $(WARN) $(SANFLAGS)
LDFLAGS += -pthread $(SANFLAGS)
LDLIBS := -lembree3 -lOpenEXRCore-3_1 -ltinygltf -ljansson -lxxhash -lpng -lstdc++ -lm

TOOLS := mesh ffcalc shoot trace reference inspect exrcmp tone
PROGRAMS := $(TOOLS:%=$(BUILD)/%)
LIB_OBJS := $(patsubst %.c,$(BUILD)/%.o,$(wildcard lib/*.c formats/*.c)) \
	$(patsubst %.cc,$(BUILD)/%.o,$(wildcard formats/*.cc))
CLI_OBJS := $(patsubst %.c,$(BUILD)/%.o,$(wildcard tools/common/*.c))
UNIT_TESTS := $(patsubst tests/unit/%.c,$(BUILD)/tests/%,$(wildcard tests/unit/test_*.c))
BENCHES := $(patsubst tests/bench/%.c,$(BUILD)/bench/%,$(wildcard tests/bench/*.c))

all: $(PROGRAMS) $(BUILD)/libcommon.a

$(BUILD)/libcommon.a: $(LIB_OBJS)
	@rm -f $@
	ar rcs $@ $^

$(PROGRAMS): $(BUILD)/%: $(BUILD)/tools/%.o $(CLI_OBJS) $(BUILD)/libcommon.a
	$(CC) $(LDFLAGS) -o $@ $^ $(LDLIBS)

$(UNIT_TESTS): $(BUILD)/tests/%: $(BUILD)/tests/unit/%.o $(BUILD)/libcommon.a
	@mkdir -p $(@D)
	$(CC) $(LDFLAGS) -o $@ $^ $(LDLIBS) -lcmocka

$(BENCHES): $(BUILD)/bench/%: $(BUILD)/tests/bench/%.o $(BUILD)/libcommon.a
	@mkdir -p $(@D)
	$(CC) $(LDFLAGS) -o $@ $^ $(LDLIBS)

$(BUILD)/%.o: %.c
	@mkdir -p $(@D)
	$(CC) $(CPPFLAGS) $(CFLAGS) -c -o $@ $<

# tinygltf and nlohmann's header are not ours to hold to our warnings.
$(BUILD)/%.o: %.cc
	@mkdir -p $(@D)
	$(CXX) $(CPPFLAGS) $(CXXFLAGS) -c -o $@ $<

unit: $(UNIT_TESTS)

clean:
	rm -rf build build-san out

.PHONY: all unit clean
.SECONDARY:
-include $(shell find $(BUILD) -name '*.d' 2>/dev/null)
