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

# Where the programs are, with a slash at the end, if not in PATH.
TWOPASS ?=

%.mesh: %.gltf
	$(TWOPASS)mesh $(MESHFLAGS) -o $@ $<

%.mesh: %.glb
	$(TWOPASS)mesh $(MESHFLAGS) -o $@ $<

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
