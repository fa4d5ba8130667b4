#define _XOPEN_SOURCE 700
#include "formats/container/atomic_file.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "lib/base/mem.h"

/* Files in the making at one time that a signal tidies up; a program has a few (an array that
 * grows large has one of its own, unlinked at once). */
enum { TEMPORARIES = 16 };

/* Names a signal handler may read: static, and in_use is set last. */
static struct temporary {
	atomic_int claimed, in_use;
	char name[PATH_MAX];
} temporaries[TEMPORARIES];

struct atomic_file {
	int fd;
	struct temporary *temporary; /* NULL: written directly */
	char *path;                  /* as the caller said, for messages */
	char *target;                /* where the rename goes */
};

static int failed(const struct atomic_file *f, const char *what, struct err *e)
{
	return err_set(e, "%s: cannot %s: %s", f->path, what, strerror(errno));
}

static struct temporary *claim_temporary(void)
{
	for (int i = 0; i < TEMPORARIES; i++)
		if (!atomic_exchange(&temporaries[i].claimed, 1))
			return &temporaries[i];
	errno = EMFILE;
	return NULL;
}

static void release_temporary(struct temporary *t)
{
	atomic_store(&t->in_use, 0);
	atomic_store(&t->claimed, 0);
}

void file_atomic_remove_temporaries(void)
{
	for (int i = 0; i < TEMPORARIES; i++)
		if (atomic_load(&temporaries[i].in_use))
			unlink(temporaries[i].name);
}

/* ".name.PID.N.tmp" beside the target. */
static int open_temporary(struct atomic_file *f, mode_t mode)
{
	const char *slash = strrchr(f->target, '/');
	int directory = slash ? (int)(slash - f->target + 1) : 0;
	struct temporary *t = claim_temporary();

	if (!t)
		return -1;
	for (int n = 0; n < 1000; n++) {
		int length = snprintf(t->name, sizeof t->name, "%.*s.%.200s.%ld.%d.tmp",
		                      directory, f->target, f->target + directory,
		                      (long)getpid(), n);

		errno = ENAMETOOLONG;
		if (length >= (int)sizeof t->name)
			break;
		f->fd = open(t->name, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, mode);
		if (f->fd >= 0) {
			atomic_store(&t->in_use, 1);
			f->temporary = t;
			return 0;
		}
		if (errno != EEXIST)
			break;
	}
	release_temporary(t);
	return -1;
}

static int open_target(struct atomic_file *f)
{
	struct stat st;
	char *real;

	if (strcmp(f->path, "-") == 0) {
		fflush(stdout);
		f->fd = STDOUT_FILENO;
		return 0;
	}
	if (stat(f->path, &st) != 0)
		return open_temporary(f, 0666);
	if (!S_ISREG(st.st_mode)) {
		f->fd = open(f->path, O_WRONLY | O_CLOEXEC);
		return f->fd < 0 ? -1 : 0;
	}
	/* Write protection is honoured although a rename would not need it. */
	if (access(f->path, W_OK) != 0)
		return -1;
	real = realpath(f->path, NULL);
	if (!real)
		return -1;
	free(f->target);
	f->target = real;
	if (open_temporary(f, 0600))
		return -1;
	return fchmod(f->fd, st.st_mode & 0777);
}

static char *copy_string(const char *s, struct err *e)
{
	size_t bytes = strlen(s) + 1;
	char *copy = mem_new(bytes, 1, "a file name", e);

	return copy ? memcpy(copy, s, bytes) : NULL;
}

struct atomic_file *file_atomic_create(const char *path, struct err *e)
{
	struct atomic_file *f = mem_new(1, sizeof *f, "an output file", e);

	if (!f)
		return NULL;
	f->fd = -1;
	f->path = copy_string(path, e);
	f->target = f->path ? copy_string(path, e) : NULL;
	if (f->target && open_target(f) == 0)
		return f;
	if (f->target)
		failed(f, "create", e);
	file_atomic_abandon(f);
	return NULL;
}

int file_atomic_write(struct atomic_file *f, const void *data, size_t bytes, struct err *e)
{
	const char *p = data;

	while (bytes) {
		ssize_t n = write(f->fd, p, bytes < (1u << 30) ? bytes : 1u << 30);

		if (n < 0 && errno == EINTR)
			continue;
		if (n <= 0)
			return failed(f, "write", e);
		p += n;
		bytes -= (size_t)n;
	}
	return 0;
}

int file_atomic_direct(const struct atomic_file *f)
{
	return f->temporary == NULL;
}

static int close_file(struct atomic_file *f)
{
	int fd = f->fd;

	f->fd = -1;
	return fd < 0 || fd == STDOUT_FILENO ? 0 : close(fd);
}

int file_atomic_finish(struct atomic_file *f, struct err *e)
{
	int status = 0;

	if (f->temporary && fsync(f->fd) != 0)
		status = failed(f, "write", e);
	if (close_file(f) != 0)
		status = failed(f, "write", e);
	if (status == 0 && f->temporary) {
		if (rename(f->temporary->name, f->target) != 0) {
			status = failed(f, "replace", e);
		} else {
			release_temporary(f->temporary);
			f->temporary = NULL;
		}
	}
	file_atomic_abandon(f);
	return status;
}

void file_atomic_abandon(struct atomic_file *f)
{
	if (!f)
		return;
	close_file(f);
	if (f->temporary) {
		unlink(f->temporary->name);
		release_temporary(f->temporary);
	}
	free(f->path);
	free(f->target);
	free(f);
}

int file_atomic_put(const char *path, const void *data, size_t bytes, struct err *e)
{
	struct atomic_file *f = file_atomic_create(path, e);

	if (!f)
		return -1;
	if (file_atomic_write(f, data, bytes, e)) {
		file_atomic_abandon(f);
		return -1;
	}
	return file_atomic_finish(f, e);
}

int file_atomic_check(const char *path, struct err *e)
{
	const char *slash = strrchr(path, '/');
	char *directory;
	int bad = 0;

	if (!slash)
		return 0;
	/* With its slash, so that a file in its place is told apart. */
	size_t n = (size_t)(slash - path) + 1;
	if (!(directory = mem_new(n + 1, 1, "path", e)))
		return -1;
	memcpy(directory, path, n);
	if (access(directory, W_OK | X_OK))
		bad = err_set(e, "%s: cannot write there: %s", path, strerror(errno));
	free(directory);
	return bad;
}
