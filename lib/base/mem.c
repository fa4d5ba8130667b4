#define _DEFAULT_SOURCE
#include "lib/base/mem.h"

#include <malloc.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

enum { LARGE_PAGE = 2 << 20, HEAP = 24 << 20, OWN_MAPPING = 32 << 20 };

/* Asks for large pages where they fit in between p and p + bytes, not touched yet. */
static void use_large_pages(void *p, size_t bytes)
{
	uintptr_t begin = ((uintptr_t)p + LARGE_PAGE - 1) & ~(uintptr_t)(LARGE_PAGE - 1);
	uintptr_t end = ((uintptr_t)p + bytes) & ~(uintptr_t)(LARGE_PAGE - 1);

	if (begin < end)
		madvise((void *)begin, end - begin, MADV_HUGEPAGE);
}

void mem_keep(void)
{
	mallopt(M_MMAP_THRESHOLD, OWN_MAPPING);
	mallopt(M_TRIM_THRESHOLD, 2 * HEAP);
	void *heap = malloc(HEAP);
	if (heap)
		use_large_pages(heap, HEAP);
	free(heap);
}

void *mem_new(size_t n, size_t size, const char *what, struct err *e)
{
	void *p = NULL;

	if (n == 0)
		n = 1;
	if (n <= SIZE_MAX / size)
		p = calloc(n, size);
	if (!p)
		err_set(e, "out of memory: %zu x %zu bytes for %s", n, size, what);
	return p;
}

int mem_reserve(struct vec *v, size_t more, size_t size, struct err *e)
{
	if (more <= v->capacity - v->n)
		return 0;
	size_t want = v->n + more, cap = v->capacity + v->capacity / 2 + 16;
	if (cap < want)
		cap = want;
	void *p = NULL;
	if (want >= more && cap <= SIZE_MAX / size)
		p = realloc(v->data, cap * size);
	if (!p)
		return err_set(e, "out of memory: %zu x %zu bytes", cap, size);
	v->data = p;
	v->capacity = cap;
	return 0;
}

int mem_append(struct vec *v, const void *src, size_t n, size_t size, struct err *e)
{
	if (mem_reserve(v, n, size, e))
		return -1;
	if (n)
		memcpy((char *)v->data + v->n * size, src, n * size);
	v->n += n;
	return 0;
}
