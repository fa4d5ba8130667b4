#include "lib/picture/image.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/mem.h"

int picture_image_new(struct image *im, int width, int height, int channels,
                      const char *const *name, struct err *e)
{
	*im = (struct image){ .width = width, .height = height };
	if (width < 1 || height < 1 || channels < 1)
		return err_set(e, "a picture of %d x %d pixels and %d channels is empty", width,
		               height, channels);
	/* Two ints' product fits size_t. */
	im->name = mem_new((size_t)channels, sizeof *im->name, "channel names", e);
	im->pixel = mem_new((size_t)width * (size_t)height,
	                    (size_t)channels * sizeof *im->pixel, "the pixels of a picture", e);
	if (!im->name || !im->pixel)
		goto fail;
	for (; im->channels < channels; im->channels++) {
		size_t bytes = strlen(name[im->channels]) + 1;
		char *copy = mem_new(bytes, 1, "a channel name", e);

		if (!copy)
			goto fail;
		memcpy(copy, name[im->channels], bytes);
		im->name[im->channels] = copy;
	}
	return 0;
fail:
	picture_image_free(im);
	return -1;
}

void picture_image_free(struct image *im)
{
	for (int c = 0; c < im->channels; c++)
		free(im->name[c]);
	free(im->name);
	free(im->pixel);
	*im = (struct image){ 0 };
}

int picture_image_channel(const struct image *im, const char *name)
{
	for (int c = 0; c < im->channels; c++)
		if (strcmp(im->name[c], name) == 0)
			return c;
	return -1;
}

static int layer_of(const struct image *im, const char *layer, const char *letters,
                    int channel[3])
{
	char name[300];

	for (int i = 0; i < 3; i++) {
		snprintf(name, sizeof name, "%s%s%c", layer ? layer : "", layer ? "." : "",
		         letters[i]);
		channel[i] = picture_image_channel(im, name);
		if (channel[i] < 0)
			return 0;
	}
	return 3;
}

int picture_image_layer(const struct image *im, const char *layer, int channel[3])
{
	int single;

	if (layer_of(im, layer, "RGB", channel) || layer_of(im, layer, "XYZ", channel))
		return 3;
	single = picture_image_channel(im, layer ? layer : "Y");
	for (int i = 0; i < 3; i++)
		channel[i] = single;
	return single < 0 ? 0 : 1;
}
