/* What the methods of form-factor computation share (private to lib/ff). */
#ifndef TWOPASS_FF_JOB_H
#define TWOPASS_FF_JOB_H

#include "lib/base/rng.h"
#include "lib/ff/ff_build.h"
#include "lib/ff/row_formula.h"
#include "lib/ff/tally.h"
#include "lib/hemicube/hemicube.h"
#include "lib/ray/locate.h"
#include "lib/ray/mirror.h"
#include "lib/ray/ray.h"

/* FF_CLOSE_RAYS: a power of two that an element close to an emitter casts.
 * FF_HALVINGS: the most of a row's rays. */
enum { FF_REPLICATES = 4, FF_DIMS = 4, FF_CLOSE_RAYS = 2048,
       FF_HALVINGS = 3 };

/* An element as a place to send rays from. Points are corner + w1 edge[0] + w2 edge[1],
 * with weights that keep a little clear of the edges. Threes are padded to four. */
struct ff_element {
	double corner[4], edge[2][4];
	float normal[4], tangent[2][4]; /* orthonormal; front */
	double cdf;               /* area of the patch's elements up to and with this */
	double per_area;
	uint32_t before;          /* 2^32 times the part of the patch's area before it */
	float per_part;           /* 1 / the same of its own area */
	double size;              /* root of its area, or how far its corners are from its centre */
};

/* The first points of the Sobol sequence, in an order in which neighbours have similar
 * directions; beyond them points follow as they are. */
struct ff_samples {
	uint32_t n;
	uint32_t *bits;           /* [FF_DIMS][n] */
};

/* What elements saw: hits of their rays on each patch-side that shoots. */
struct ff_receiver_hits {
	uint32_t column, count;   /* element-side, its rays that landed here */
};

struct ff_reciprocal {
	uint32_t rays;            /* from an element-side; 0: nothing was gathered */
	int alone;                /* no ideal surfaces: all that rows tell is where rays land */
	uint64_t *start;          /* [2P+1] of a patch-side, ordered by place */
	struct ff_receiver_hits *seen;
	double (*centre)[4];      /* [P] of a patch, and the distance of its farthest vertex */
	double *escape, *black;   /* [2P] parts of what leaves a patch-side, the same rays
	                             taken as its own */
};

/* Shared, read-only while rows are computed. */
struct ff_job {
	const struct model *m;
	struct ff_options o;
	struct ray_scene *rays;
	struct hemicube_scene *cubes; /* hemicube only */
	struct hemicube_grid grid;
	struct locator locator;
	uint8_t *is_black;        /* [2P] not modelled: absorbs */
	uint8_t *is_ideal;        /* [2P] sends light on along an ideal direction */
	struct ff_element *element; /* [E] */
	uint8_t *shoots_diffuse;  /* [2P] light can leave this side Lambertian */
	uint8_t *shoots_lobe;     /* [2P] ... by an emission lobe */
	uint8_t *has_lobe;        /* [2P] light arriving here leaves by a finite lobe */
	uint8_t *emits;           /* [2P] gives light of its own */
	uint8_t *is_source;       /* [2P] any light leaves here */
	uint32_t chain_most;      /* where counts of ideal events of a colour stop */
	uint32_t lobes;           /* patch-sides that have one */
	int has_panes, has_ideal; /* any clear pane; any ideal surface */
	struct light_images images; /* in one mirror each */
	double small_area;        /* elements below gather with a quarter of the rays: what they
	                             lack weighs little */
	struct ff_samples of_rows, of_reciprocal, of_small;
	struct tally_places places;
	struct ff_reciprocal reciprocal;
	uint8_t *halvings;        /* [2P] how often the rays of a row are halved; NULL: never */
	struct ff_formula formula;
};

/* A way that light can come to a directional patch-side: sampled backwards. */
struct ff_incident {
	uint32_t source, chain;   /* patch-side it left; chain as the light passes it */
	uint32_t element;         /* where it arrives */
	uint32_t view;            /* hemicube: which sample point */
	double w;
	double x[3], l[3];        /* the point, the unit direction to the source */
};

/* A batch of rays: numbers, origins, directions, where they land. */
struct ff_ray_batch {
	uint32_t element[RAY_BATCH];      /* where each begins */
	uint32_t choice[RAY_BATCH];       /* 32 bits to choose the element by */
	float u[4][RAY_BATCH];            /* numbers in [0,1): position, direction */
	struct ray_batch ray;
	uint32_t hit[RAY_BATCH];          /* element where each lands */
};

/* A hemicube's place: just off one side of the patch. */
struct view {
	double eye[3], frame[3][3];
	uint32_t element;
};

struct ff_thread {
	const struct ff_job *job;
	struct tally tally;
	struct rng rng;
	struct vec incident;      /* struct ff_incident */
	struct vec pairs;         /* struct ff_incident */
	int capturing;
	double capture_weight;    /* of a capture, per weight of the ray */
	uint32_t lobe_depth;      /* lobes that the row's light is followed through */
	int bent_only;            /* landings of light that came straight are known, and if
	                             there are images, of light turned once */
	double turned;            /* weight of the others, then */
	struct ff_incident now;       /* the sample being followed, while capturing */
	struct hemicube cube;
	uint32_t *item;           /* hemicube: [points][2 sides][pixels] of the patch */
	struct view *view;        /* hemicube: [points][2 sides] */
	double rays;
	struct vec shares;        /* struct ff_share */
	struct vec lit;           /* struct lit, of the light in work */
	struct exchanger *formula; /* NULL: nothing is computed by formula */
	struct ff_ray_batch lobe; /* lobe rays waiting to be cast */
	uint32_t lobes;
	struct vec chain_map;     /* local -> whole */
};

static inline int ff_by_formula(const struct ff_options *o)
{
	return o->method == FF_ANALYTIC || o->method == FF_AUTO;
}

/* What a job needs whatever it makes. O(elements + triangles log triangles). 0, or -1 and e;
 * either way free it. */
int ff_job_init(struct ff_job *j, const struct model *m, const struct ff_options *o,
                struct err *e);
void ff_job_free(struct ff_job *j);

/* What rows that are computed one by one, of patches or of lights alone, need beside. */
int ff_job_prepare(struct ff_job *j, int patches, struct err *e);

/* Fills job->of_rows, of_gathering, of_small. O(points log points). 0, or -1 and e. */
int ff_sobol_points(struct ff_job *j, struct err *e);

int ff_thread_init(struct ff_thread *t, const struct ff_job *j, struct err *e);
void ff_thread_free(struct ff_thread *t);

/* Sets job->chain_most: as high as keeps chains few, by what a few rays meet. O(depth)
 * rays. 0, or -1 and e. */
int ff_find_chain_limit(struct ff_job *j, struct err *e);

/* Fills job->element. O(elements). */
void ff_element_table(struct ff_job *j);

/* The element of a patch that a number in [0,1) chooses by area; what is left of the
 * number, again uniform, replaces it. */
uint32_t ff_choose(const struct ff_job *j, uint32_t patch, double *u);

/* A point on a patch, uniform by area, from two numbers in [0,1): its element and
 * position (on the surface, not moved off it). */
uint32_t ff_point(const struct ff_job *j, uint32_t patch, double u0, double u1, double x[3]);

/* The scramble of a replicate of the rays of a row; row: twice its patch-side, and 1 more
 * for its emission. */
struct ff_scramble {
	uint32_t seed[FF_DIMS];
};
struct ff_scramble ff_scramble(const struct ff_job *j, uint32_t row, uint32_t replicate);

/* The numbers of rays first to first + n (n <= RAY_BATCH) of a scrambled replicate. */
void ff_rays_numbers(const struct ff_samples *s, const uint32_t seed[4], uint32_t first,
                     uint32_t n, struct ff_ray_batch *b);

/* Elements of a patch for the rays, by area; u[0] becomes what is left of the choice. */
void ff_rays_elements(const struct ff_job *j, uint32_t patch, uint32_t n,
                      struct ff_ray_batch *b);

/* Origins off a side of the elements, and Lambertian directions from there. */
void ff_rays_origins(const struct ff_job *j, int side, uint32_t n, struct ff_ray_batch *b);
void ff_rays_directions(const struct ff_job *j, int side, uint32_t n,
                        struct ff_ray_batch *b);

/* Adds a batch's rows to the statistics. */
void ff_stats_count(struct ff_stats *s, const struct ff *f);
void ff_stats_count_pairs(struct ff_stats *s, const struct exchange_counts *c);

/* Casts n rays and finds the elements where they land. */
void ff_rays_cast(const struct ff_job *j, uint32_t n, struct ff_ray_batch *b);

/* The same from one element-side: rays first to first + n of a replicate. */
void ff_rays_from_element(const struct ff_job *j, const struct ff_samples *s,
                          const uint32_t seed[4], uint32_t column, uint32_t first,
                          uint32_t n, struct ff_ray_batch *b);

/* Unit normal of a side of an element. */
void ff_normal(const struct ff_job *j, uint32_t element, int side, double n[3]);

/* Follows a ray (origin already off its surface) carrying weight w of the row's
 * flux to where it lands, and on through ideal surfaces; tallies everything. */
void ff_follow(struct ff_thread *t, const double org[3], const double dir[3], double w,
               uint32_t chain);

/* The same for a ray of chain 0 whose first landing has been tallied already. */
void ff_follow_on(struct ff_thread *t, const double org[3], const double dir[3], double w);

/* How many rays each side of an element gathers with. */
static inline uint32_t ff_reciprocal_rays(const struct ff_job *j, uint32_t element)
{
	return j->m->element.area[element] < j->small_area ? j->o.gather / 4 : j->o.gather;
}

/* Rays that a patch-side's diffuse row casts, if any. */
static inline uint32_t ff_row_rays(const struct ff_job *j, uint32_t ps)
{
	return j->emits[ps] ? j->o.rays * j->o.emitter_gain
	                    : j->o.rays >> (j->halvings ? j->halvings[ps] : 0);
}

/* How often the rays of a row can be halved so that each replicate is a whole number. */
int ff_most_halvings(uint32_t rays);

/* Sets job->halvings by what was gathered: rows that carry less light than others cast fewer
 * rays. O(pairs seen). 0, or -1 and e. */
int ff_share_rays(struct ff_job *j, struct err *e);

/* Casts ff_reciprocal_rays rays from every element-side that is modelled and no ideal mirror or
 * pane, jointly stratified over its area and hemisphere, into j->gather; adds to *rays.
 * Memory: 16 bytes for every pair of an element-side and a patch-side that it sees.
 * O(element-sides x rays x log triangles). 0, or -1 and e. */
int ff_reciprocal_cast(struct ff_job *j, double *rays, const struct progress *progress,
                       struct err *e);
void ff_reciprocal_free(struct ff_reciprocal *g);

/* 1 if the row of a patch-side is made with point pairs (ff_emitter_row): an emitter's, unless
 * looking at every element costs more than the row's rays. */
int ff_row_is_of_emitter(const struct ff_job *j, uint32_t patch_side);

/* 1 if the row of a patch-side needs no rays of its own. */
int ff_row_is_reciprocal(const struct ff_job *j, uint32_t patch_side);

/* A row of direct sight: t->sights becomes F[source -> element-side] of every
 * element-side that may see the source, with about `rays` rays between them. Returns
 * their sum. O(elements + rays). */
struct ff_share {
	uint32_t column;
	double w, variance;
};
double ff_emitter_row(struct ff_thread *t, uint32_t source, uint32_t rays, struct err *e);

/* What a row's weights are counted in. */
struct ff_weight {
	uint32_t samples;         /* independent ones that the row is worth */
	double total;
};

/* Lets what was gathered, or seen, decide where the light of patch-side ps lands: of what
 * the `cast` rays of its own, tallied already, brought to elements that know better, or
 * (cast = 0) of all that neither escapes nor meets a black side. 1 if it did, else the
 * tally is left alone. */
int ff_combine_estimates(struct ff_thread *t, uint32_t ps, uint32_t cast, struct ff_weight *w);

/* All rows of one patch into the batch. 0, or -1 and e. */
int ff_patch_rays(struct ff_thread *t, uint32_t patch, struct ff_batch *b, struct err *e);
/* Shares the light of patch-side ps, whose views are set and whose hemicubes are tallied,
 * anew among elements that few pixels show. O(elements x points) rays. */
void ff_hemicube_subpixel(struct ff_thread *t, uint32_t ps);

int ff_patch_hemicube(struct ff_thread *t, uint32_t patch, struct ff_batch *b, struct err *e);

/* The chain of events that a light's rays pass from `to` to `from`: straight and through
 * clear panes; or by way of a mirror, when the ray from `from` towards the image meets it
 * first. CHAIN_NONE if anything else is in their way. */
uint32_t ff_light_straight(struct ff_thread *t, const double from[3], const double to[3]);
uint32_t ff_light_mirrored(struct ff_thread *t, const struct mirror_plane *mirror, size_t light,
                           const double from[3], const double toward[3]);

/* The row of a punctual light into the batch; none if it has no flux. 0, or -1 and e.
 * O(elements + rays). */
int ff_light_row(struct ff_thread *t, uint32_t light, struct ff_batch *b, struct err *e);

/* Captures the ways that light of all punctual lights comes straight to a directional
 * patch-side. O(lights). 0, or -1 and e. */
int ff_light_incident(struct ff_thread *t, uint32_t patch_side, struct err *e);

/* 1 if a source gives light of its own. */
static inline int ff_emits(const struct ff_job *j, uint32_t source)
{
	return source >= 2 * j->m->patch.n || j->emits[source];
}

/* Casts one lobe direction from a capture's point off a side. */
typedef void ff_cast_fn(struct ff_thread *t, const struct ff_incident *c, int side,
                        const double dir[3], double w);

/* Casts what waits in t->lobe. */
void ff_lobes_cast(struct ff_thread *t);

/* Turns the captures of a directional patch-side into links with their G rows. */
int ff_directional_rows(struct ff_thread *t, uint32_t patch_side, ff_cast_fn *cast, struct ff_batch *b,
                        struct err *e);

#endif
