/* What the methods of form-factor computation share: the state of a job and of its threads
 * (for lib/ff). */
#ifndef TWOPASS_FF_INTERNAL_H
#define TWOPASS_FF_INTERNAL_H

#include "lib/base/rng.h"
#include "lib/ff_rays/ff_options.h"
#include "lib/ff_rays/row_formula.h"
#include "lib/ff_tally/tally.h"
#include "lib/hemicube/hemicube.h"
#include "lib/ray/locate.h"
#include "lib/ray/light_visibility.h"
#include "lib/ray/ray.h"

/* Counts. FF_CLOSE_RAYS: a power of two that an element close to an emitter casts.
 * FF_HALVINGS: the most of a row's rays, down to an eighth. Both are guesses; the errors stated
 * with them are measured by tests/tools/stated_errors.t. */
enum { FF_REPLICATES = 4, FF_DIMS = 4, FF_CLOSE_RAYS = 2048,
       FF_HALVINGS = 3, FF_PILOTS = 4 };

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

/* Hits of elements' rays on each patch-side that shoots. */
struct ff_receiver_hits {
	uint32_t column, count;   /* element-side, its rays that landed here */
};

struct ff_reciprocal {
	uint32_t rays;            /* from an element-side; 0: nothing was gathered */
	int alone;                /* no ideal surfaces: all that rows tell is where rays land */
	uint64_t *start;          /* [2P+1] of a patch-side, ordered by place */
	struct ff_receiver_hits *hits;
	double (*centre)[4];      /* [P] of a patch, and the distance of its farthest vertex */
	double *escape, *black;   /* [2P] parts of what leaves a patch-side, the same rays
	                             taken as its own */
};

/* Landings of a patch's rays, in the order of places. */
struct ff_patch_landings {
	struct array landing, chain; /* uint32_t; chains by the thread's numbers, if any event is */
	int thread;
};

struct ff_landings {
	const struct ff_job *job;
	size_t threads;
	struct ff_patch_landings *patch; /* [P] until they are put into batches */
	uint32_t *rays, *lost, *count; /* [2E] by place */
	struct chains *chains;    /* [threads] */
	struct array *map;        /* [threads] to the numbers of the whole */
	struct lobe_table *table; /* [events] of finite lobes */
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
	int has_ideal;            /* any ideal surface */
	struct light_visibility lights; /* with images in one mirror each */
	double small_area;        /* elements below gather with a quarter of the rays: what they
	                             lack weighs little */
	struct ff_samples of_rows, of_reciprocal, of_small;
	struct tally_places places;
	struct ff_reciprocal reciprocal;
	struct ff_landings landings;
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

/* What an element-side gets of a row, by a way of its own. */
struct ff_share {
	uint32_t column;
	double w, variance;
};

struct ff_thread {
	const struct ff_job *job;
	struct tally tally;
	struct rng rng;
	struct array incident;    /* struct ff_incident */
	struct array pairs;       /* struct ff_incident */
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
	double (*pilot_sum)[FF_PILOTS]; /* one hemicube a side: [2E] what tells its error */
	uint32_t *pilot_item;     /* [FF_PILOTS][pixels] */
	double *weight;           /* the paper's: [pixels] */
	double rays;
	struct array shares;      /* struct ff_share */
	uint32_t boost;           /* weights of a row over its rays: ray_guide.h */
	struct array arrivals;    /* struct light_arrival, of the light in work */
	struct exchanger *formula; /* NULL: nothing is computed by formula */
	struct ff_ray_batch lobe; /* lobe rays waiting to be cast */
	uint32_t lobes;
	struct array chain_map;   /* local -> whole */
};

#endif
