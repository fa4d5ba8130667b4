#include "lib/reference/pathtrace.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"
#include "lib/base/vec.h"
#include "lib/data/punctual.h"
#include "lib/reference/pathtrace_internal.h"
#include "lib/scatter/bsdf.h"

static void planes(struct pathtrace *p)
{
	const struct model *m = p->m;

	for (size_t i = 0; i < m->triangle.n; i++) {
		const uint32_t *c = &m->triangle.corner[3 * i];
		v3_area(&m->vertex[3 * (size_t)c[0]], &m->vertex[3 * (size_t)c[1]],
		        &m->vertex[3 * (size_t)c[2]], &p->normal[3 * i]);
		p->area[i] = v3_normalise(&p->normal[3 * i]);
	}
}

static uint32_t material_of(const struct model *m, size_t triangle)
{
	return m->surface.material[m->triangle.surface[triangle]];
}

/* Mean of the bands' fluxes; adds them to p->emitted. */
static double side_flux(struct pathtrace *p, size_t triangle, int side)
{
	double sum = 0;

	for (int b = 0; b < p->m->bands; b++) {
		double flux = p->area[triangle] *
		              bsdf_exitance(&p->m->material, material_of(p->m, triangle), side, b);
		p->emitted[b] += flux;
		sum += flux;
	}
	return sum / p->m->bands;
}

/* Mean of the bands' fluxes of all lights, cumulated; adds them to p->emitted. */
static double list_lights(struct pathtrace *p)
{
	const struct model *m = p->m;

	for (size_t i = 0; i < m->light.n; i++) {
		double sum = 0;
		for (int b = 0; b < m->bands; b++) {
			p->emitted[b] += model_light_flux(m, i, b);
			sum += model_light_flux(m, i, b) / m->bands;
		}
		p->light_below[i + 1] = p->light_below[i] + sum;
	}
	return p->light_below[m->light.n];
}

static int list_emitters(struct pathtrace *p, struct err *e)
{
	struct array list = { 0 };
	double total = 0, lights = list_lights(p);

	for (size_t i = 0; i < 2 * p->m->triangle.n; i++) {
		double flux = side_flux(p, i / 2, (int)(i % 2));
		struct emitter one = { .triangle = (uint32_t)(i / 2), .side = (int)(i % 2),
		                       .chance = flux, .below = total };
		if (!(flux > 0))
			continue;
		if (mem_append(&list, &one, 1, sizeof one, e)) {
			free(list.data);
			return -1;
		}
		total += flux;
	}
	p->emitter = list.data;
	p->emitters = list.n;
	for (size_t i = 0; i < p->emitters; i++) {
		struct emitter *at = &p->emitter[i];
		at->chance /= total;
		at->below /= total;
		p->density[2 * (size_t)at->triangle + (size_t)at->side] =
			at->chance / p->area[at->triangle];
	}
	for (size_t i = 0; i <= p->m->light.n && total + lights > 0; i++)
		p->light_below[i] /= total + lights;
	return total + lights > 0 ? 0 : err_set(e, "nothing emits light; give a material an "
	                                        "emission, or add a light");
}

struct pathtrace *pathtrace_new(const struct model *m, const struct ray_scene *rays,
                                struct err *e)
{
	struct pathtrace *p = mem_new(1, sizeof *p, "path tracer", e);

	if (!p)
		return NULL;
	p->m = m;
	p->rays = rays;
	p->normal = mem_new(m->triangle.n, 3 * sizeof *p->normal, "triangle normals", e);
	p->area = mem_new(m->triangle.n, sizeof *p->area, "triangle areas", e);
	p->density = mem_new(m->triangle.n, 2 * sizeof *p->density, "emitters", e);
	p->light_below = mem_new(m->light.n + 1, sizeof *p->light_below, "lights", e);
	if (p->normal && p->area && p->density && p->light_below) {
		planes(p);
		if (!list_emitters(p, e) && !ray_light_visibility_new(m, rays, &p->ways, e))
			return p;
	}
	pathtrace_free(p);
	return NULL;
}

void pathtrace_free(struct pathtrace *p)
{
	if (!p)
		return;
	free(p->normal);
	free(p->area);
	free(p->density);
	free(p->emitter);
	free(p->light_below);
	ray_light_visibility_free(&p->ways);
	free(p);
}

int pathtrace_diverges(const struct model *m)
{
	if (m->lobe != LOBE_PAPER)
		return 0;
	for (size_t i = 0; i < 4 * m->material.n; i++)
		if (bsdf_has_lobe(&m->material, i / 4, (int)(i / 2 % 2), (int)(i % 2)))
			return 1;
	return 0;
}

int pathtrace_misses(const struct pathtrace *p)
{
	return p->m->light.n && !p->ways.images.complete;
}

int pathtrace_meet(const struct pathtrace *p, const double org[3], const double dir[3],
                   struct vertex *v)
{
	const struct model *m = p->m;
	struct ray_hit hit;

	ray_nearest(p->rays, org, dir, &hit);
	if (hit.triangle == RAY_MISS)
		return 0;
	v->triangle = hit.triangle;
	v->material = material_of(m, hit.triangle);
	v->n = &p->normal[3 * (size_t)hit.triangle];
	v->side = v3_dot(v->n, dir) > 0 ? BACK : FRONT;
	v->t = hit.t;
	memcpy(v->w, hit.w, sizeof v->w);
	ray_point(p->rays, m, hit.triangle, hit.w, v->x);
	return 1;
}

void pathtrace_leave(const struct pathtrace *p, const double n[3], const double x[3],
                     const double dir[3], double org[3])
{
	double up = v3_dot(n, dir) < 0 ? -1 : 1, normal[3];

	for (int k = 0; k < 3; k++) {
		normal[k] = up * n[k];
		org[k] = x[k];
	}
	ray_leave(p->rays, normal, org);
}

const struct emitter *pathtrace_emitter(const struct pathtrace *p, const double u[3],
                                        double x[3])
{
	size_t lo = 0, hi = p->emitters;

	while (hi - lo > 1) {
		size_t mid = lo + (hi - lo) / 2;
		if (p->emitter[mid].below <= u[0])
			lo = mid;
		else
			hi = mid;
	}
	double s = sqrt(u[1]), w[3] = { 1 - s, s * (1 - u[2]), s * u[2] };
	ray_point(p->rays, p->m, p->emitter[lo].triangle, w, x);
	return &p->emitter[lo];
}

int pathtrace_roulette(double *throughput, int bands, struct rng *r)
{
	/* Below 1, so that paths end even between surfaces that absorb nothing (after ten thousand
	 * events, on average); not by much, because weights must not grow where little is absorbed.
	 * A guess. */
	static const double most = .9999;
	double go_on = 0;

	for (int b = 0; b < bands; b++)
		go_on = fmax(go_on, throughput[b]);
	go_on = fmin(go_on, most);
	if (rng_uniform(r) >= go_on)
		return 0;
	for (int b = 0; b < bands; b++)
		throughput[b] /= go_on;
	return 1;
}
