# pipeline.mk: from glTF to pictures. Include it in a Makefile of your own:
#
#     include /usr/local/share/twopass/pipeline.mk
#     all: room.front.png room.back.png
#
# room.front.exr is what camera `front` of room.gltf (or room.glb) sees. Camera names
# that make cannot hold (spaces, dots) need a rule of your own. Flags of each stage:
MESHFLAGS ?=
FFCALCFLAGS ?=
SHOOTFLAGS ?=
TRACEFLAGS ?=
TONEFLAGS ?=

# How often the mesh is refined where the solution is in error; to be set before this file is
# included. room.mesh is then made from room.pass0.rad, or with REFINE = 2 from room.pass1.rad,
# and so on. These earlier solutions only tell where to refine, so form factors of theirs may
# be rough. A new paint or lamp can move the refinement, and then costs new form factors.
REFINE ?= 0
REFINEFLAGS ?=
PASSFLAGS ?= -n 1024

# Where the programs are, with a slash at the end, if not in PATH.
TWOPASS ?=

ifeq ($(strip $(REFINE)),0)
%.mesh: %.gltf
	$(TWOPASS)mesh $(MESHFLAGS) -o $@ $<

%.mesh: %.glb
	$(TWOPASS)mesh $(MESHFLAGS) -o $@ $<
else
%.pass0.mesh: %.gltf
	$(TWOPASS)mesh $(MESHFLAGS) -o $@ $<

%.pass0.mesh: %.glb
	$(TWOPASS)mesh $(MESHFLAGS) -o $@ $<

# $(1) from the solution of pass $(2)
define twopass-refine
$(1).mesh: %.gltf %.pass$(2).rad
	$$(TWOPASS)mesh $$(MESHFLAGS) $$(REFINEFLAGS) --refine $$*.pass$(2).rad -o $$@ $$<

$(1).mesh: %.glb %.pass$(2).rad
	$$(TWOPASS)mesh $$(MESHFLAGS) $$(REFINEFLAGS) --refine $$*.pass$(2).rad -o $$@ $$<

%.pass$(2).ff: %.pass$(2).mesh
	$$(TWOPASS)ffcalc $$(FFCALCFLAGS) $$(PASSFLAGS) -o $$@ $$<

%.pass$(2).rad: %.pass$(2).mesh %.pass$(2).ff
	$$(TWOPASS)shoot $$(SHOOTFLAGS) -o $$@ $$^

.PRECIOUS: %.pass$(2).mesh %.pass$(2).ff %.pass$(2).rad

endef
twopass-passes := $(shell seq 1 $(REFINE))
$(foreach k,$(twopass-passes),$(eval $(call twopass-refine,%$(if $(filter $(REFINE),$(k)),,.pass$(k)),$(shell expr $(k) - 1))))
endif

%.ff: %.mesh
	$(TWOPASS)ffcalc $(FFCALCFLAGS) -o $@ $<

%.rad: %.mesh %.ff
	$(TWOPASS)shoot $(SHOOTFLAGS) -o $@ $^

.SECONDEXPANSION:
%.exr: $$(basename $$*).rad
	$(TWOPASS)trace $(TRACEFLAGS) -c $(patsubst .%,%,$(suffix $*)) -o $@ $<

%.png: %.exr
	$(TWOPASS)tone $(TONEFLAGS) -o $@ $<

# Caches are the point: keep them.
.PRECIOUS: %.mesh %.ff %.rad %.exr
