/* Texts and objects of the JSON that several parts of the reader need. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "formats/gltf/gltf_doc.h"
#include "lib/base/mem.h"

void gltf_one_line(char *text)
{
	for (unsigned char *p = (unsigned char *)text; *p; p++)
		if (*p < 0x20 || *p == 0x7f)
			*p = ' ';
}

char *gltf_unique_name(json_t *taken, const char *want, struct err *e)
{
	size_t size = strlen(want) + 24;
	char *name = mem_new(size, 1, "a name", e);

	if (!name)
		return NULL;
	snprintf(name, size, "%s", want);
	gltf_one_line(name);
	json_t *count = json_object_get(taken, name);
	size_t n = strlen(name);
	json_int_t k = count ? json_integer_value(count) : 0;
	while (k && json_object_get(taken, name))
		snprintf(name + n, size - n, "#%" JSON_INTEGER_FORMAT, ++k);
	if (k)
		json_integer_set(count, k);
	if (json_object_set_new(taken, name, json_integer(1))) {
		err_set(e, "out of memory for names");
		free(name);
		return NULL;
	}
	return name;
}

json_t *gltf_lights_json(const json_t *root)
{
	return json_object_get(json_object_get(json_object_get(root, "extensions"), GLTF_LIGHTS),
	                       "lights");
}
