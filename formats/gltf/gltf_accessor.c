/* Elements of accessors, of any type and layout (gltf_doc.h). */
#include <string.h>

#include "formats/gltf/gltf_doc.h"

size_t gltf_component_size(int component)
{
	switch (component) {
	case GLTF_I8:
	case GLTF_U8:
		return 1;
	case GLTF_I16:
	case GLTF_U16:
		return 2;
	case GLTF_U32:
	case GLTF_F32:
		return 4;
	default:
		return 0;
	}
}

/* Columns of matrices begin at multiples of 4 bytes. */
size_t gltf_element_size(const struct gltf_accessor *a)
{
	size_t column = (size_t)a->rows * gltf_component_size(a->at.component);

	if (a->columns > 1)
		column = (column + 3) / 4 * 4;
	return column * (size_t)a->columns;
}

static const unsigned char *bytes_at(const struct gltf_reader *g, struct gltf_place at)
{
	const struct gltf_view *v = &g->doc.view[at.view];

	return g->source.buffer[v->buffer].data + v->offset + at.offset;
}

struct gltf_elements gltf_access(const struct gltf_reader *g, int accessor)
{
	const struct gltf_accessor *a = &g->doc.accessor[accessor];
	size_t size = gltf_element_size(a), stride = size;
	struct gltf_elements v = {
		.count = a->count,
		.component = a->at.component,
		.n = a->rows,
		.normalised = a->normalised,
		.sparse = a->sparse,
		.index_component = a->index.component,
		.value_stride = size,
	};

	if (a->at.view != GLTF_NONE) {
		v.base = bytes_at(g, a->at);
		if (g->doc.view[a->at.view].stride)
			stride = g->doc.view[a->at.view].stride;
	}
	v.stride = stride;
	if (a->sparse) {
		v.index = bytes_at(g, a->index);
		v.value = bytes_at(g, a->value);
	}
	return v;
}

static uint32_t unsigned_at(const unsigned char *p, int component)
{
	uint16_t u16;
	uint32_t u32;

	switch (component) {
	case GLTF_U8:
		return *p;
	case GLTF_U16:
		memcpy(&u16, p, sizeof u16);
		return u16;
	default:
		memcpy(&u32, p, sizeof u32);
		return u32;
	}
}

/* Normalised integers: f = c / (2^b - 1), or max(c / (2^(b-1) - 1), -1) if signed
 * (glTF 2.0, 3.6.2.2). */
static double signed_unit(double c, double max, int normalised)
{
	if (!normalised)
		return c;
	return c < -max ? -1 : c / max;
}

static double number_at(const unsigned char *p, int component, int normalised)
{
	int8_t i8;
	int16_t i16;
	float f32;

	switch (component) {
	case GLTF_I8:
		memcpy(&i8, p, sizeof i8);
		return signed_unit(i8, 127, normalised);
	case GLTF_I16:
		memcpy(&i16, p, sizeof i16);
		return signed_unit(i16, 32767, normalised);
	case GLTF_U8:
		return signed_unit(unsigned_at(p, component), 255, normalised);
	case GLTF_U16:
		return signed_unit(unsigned_at(p, component), 65535, normalised);
	case GLTF_F32:
		memcpy(&f32, p, sizeof f32);
		return (double)f32;
	default:
		return unsigned_at(p, component);
	}
}

uint32_t gltf_sparse_index(const struct gltf_elements *v, size_t k)
{
	return unsigned_at(v->index + k * gltf_component_size(v->index_component),
	                   v->index_component);
}

/* The bytes of element i, NULL = zeros. */
static const unsigned char *element_at(const struct gltf_elements *v, size_t i)
{
	size_t low = 0, high = v->sparse;

	while (low < high) {
		size_t middle = low + (high - low) / 2;
		uint32_t at = gltf_sparse_index(v, middle);
		if (at == i)
			return v->value + middle * v->value_stride;
		if (at < i)
			low = middle + 1;
		else
			high = middle;
	}
	return v->base ? v->base + i * v->stride : NULL;
}

void gltf_element(const struct gltf_elements *v, size_t i, double *out)
{
	const unsigned char *p = element_at(v, i);
	size_t size = gltf_component_size(v->component);

	for (int k = 0; k < v->n; k++)
		out[k] = p ? number_at(p + (size_t)k * size, v->component, v->normalised) : 0;
}

uint32_t gltf_index(const struct gltf_elements *v, size_t i)
{
	const unsigned char *p = element_at(v, i);

	return p ? unsigned_at(p, v->component) : 0;
}
