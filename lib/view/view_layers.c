#include "lib/view/view_layers.h"

#include <stdio.h>

const char *const view_layer_name[] = { "diffuse", "directional", "emission", "Z", "N", "element",
	"patch", "error", "all", NULL };

/* Names of the channels in the order of struct view_planes. */
struct names {
	char text[3 * 5 + 3 + 3 + BANDS_MAX][24];
	int n;
};

static int add_names(struct names *s, int asked, const char *prefix, const char *const *suffix,
                     int count)
{
	int first = s->n;

	if (!asked)
		return -1;
	for (int i = 0; i < count; i++)
		snprintf(s->text[s->n++], sizeof *s->text, "%s%s", prefix, suffix[i]);
	return first;
}

int view_picture_new(const struct view_frame *f, unsigned l, int bands, struct view_planes *at,
                     struct image *picture, struct err *e)
{
	static const char *const rgb[] = { "R", "G", "B" }, *const xyz[] = { "X", "Y", "Z" };
	static const char *const none[] = { "" };
	struct names s = { .n = 0 };
	const char *list[sizeof s.text / sizeof *s.text];

	add_names(&s, 1, "", rgb, 3);
	at->bands = bands == 1 || bands == 3 ? -1 : s.n;
	for (int b = 0; b < bands && at->bands >= 0; b++)
		snprintf(s.text[s.n++], sizeof *s.text, "band.%d", b);
	at->diffuse = add_names(&s, l & VIEW_DIFFUSE, "diffuse.", rgb, 3);
	at->directional = add_names(&s, l & VIEW_DIRECTIONAL, "directional.", rgb, 3);
	at->emission = add_names(&s, l & VIEW_EMISSION, "emission.", rgb, 3);
	at->z = add_names(&s, l & VIEW_Z, "Z", none, 1);
	at->normal = add_names(&s, l & VIEW_N, "N.", xyz, 3);
	at->element = add_names(&s, l & VIEW_ELEMENT, "element", none, 1);
	at->patch = add_names(&s, l & VIEW_PATCH, "patch", none, 1);
	at->error = add_names(&s, l & VIEW_ERROR, "error.", rgb, 3);
	for (int i = 0; i < s.n; i++)
		list[i] = s.text[i];
	return picture_image_new(picture, f->width, f->height, s.n, list, e);
}
