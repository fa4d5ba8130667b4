#include "formats/cache/array_stats.h"

#include <math.h>

/* Sums of a block are added to sums of blocks: rounding grows with neither.
 * About the root of how many values there are; any such number does. */
enum { BLOCK = 4096 };

static double number(const struct container_view *v, uint64_t i)
{
	switch (v->type) {
	case DT_F64: return ((const double *)v->data)[i];
	case DT_U64: return (double)((const uint64_t *)v->data)[i];
	case DT_I64: return (double)((const int64_t *)v->data)[i];
	case DT_F32: return (double)((const float *)v->data)[i];
	case DT_U32: return ((const uint32_t *)v->data)[i];
	case DT_I32: return ((const int32_t *)v->data)[i];
	case DT_U16: return ((const uint16_t *)v->data)[i];
	case DT_U8:
	case DT_COUNT: break;
	}
	return ((const uint8_t *)v->data)[i];
}

void file_array_stats(const struct container_view *v, struct array_stats *out)
{
	double sum = 0;

	*out = (struct array_stats){ .min = (double)INFINITY, .max = -(double)INFINITY };
	for (uint64_t begin = 0; begin < v->count; begin += BLOCK) {
		double part = 0;
		for (uint64_t i = begin; i < v->count && i < begin + BLOCK; i++) {
			double x = number(v, i);
			if (isnan(x)) {
				out->nans++;
				continue;
			}
			part += x;
			out->min = fmin(out->min, x);
			out->max = fmax(out->max, x);
		}
		sum += part;
	}
	uint64_t n = v->count - out->nans;
	out->mean = sum / (double)n;
	if (n == 0)
		out->min = out->mean = out->max = (double)NAN;
}
