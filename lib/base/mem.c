#define _DEFAULT_SOURCE
#include "lib/base/mem.h"

#include <malloc.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

/* Bytes. A large page is x86-64's. The heap of 24 MB that is begun with and kept is a guess at what
 * small scenes take. What is larger than 32 MB is mapped by itself: the most that glibc allows. */
enum { LARGE_PAGE = 2 << 20, HEAP = 24 << 20, OWN_MAPPING = 32 << 20 };

/* A count of elements that a growable array begins with, so that the first few appended ones do
 * not each move it: a guess. */
enum { ROOM_AT_FIRST = 16 };

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

int mem_new_arrays(const struct mem_array *a, size_t n, const char *what, struct err *e)
{
	int bad = 0;

	for (size_t i = 0; i < n; i++) {
		void *p = mem_new(a[i].n, a[i].size, what, e);
		memcpy(a[i].slot, &p, sizeof p);
		bad |= !p;
	}
	return bad ? -1 : 0;
}

void mem_free_arrays(void *const *array, size_t n)
{
	for (size_t i = 0; i < n; i++)
		free(array[i]);
}

int mem_reserve(struct array *a, size_t more, size_t size, struct err *e)
{
	if (more <= a->capacity - a->n)
		return 0;
	size_t want = a->n + more, cap = a->capacity + a->capacity / 2 + ROOM_AT_FIRST;
	if (cap < want)
		cap = want;
	void *p = NULL;
	if (want >= more && cap <= SIZE_MAX / size)
		p = realloc(a->data, cap * size);
	if (!p)
		return err_set(e, "out of memory: %zu x %zu bytes", cap, size);
	a->data = p;
	a->capacity = cap;
	return 0;
}

int mem_append(struct array *a, const void *src, size_t n, size_t size, struct err *e)
{
	if (mem_reserve(a, n, size, e))
		return -1;
	if (n)
		memcpy((char *)a->data + a->n * size, src, n * size);
	a->n += n;
	return 0;
}
