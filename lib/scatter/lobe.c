#include "lib/scatter/lobe.h"

#include <math.h>
#include <string.h>

#include "lib/base/constants.h"
#include "lib/base/rng.h"
#include "lib/base/vec.h"

double bsdf_lobe_power(double k, double cos_gamma)
{
	if (!(cos_gamma > 0))
		return 0;
	return cos_gamma >= 1 || k == 0 ? 1 : exp(k * log(cos_gamma));
}

/* Gamma(a + 1) / Gamma(a + 1/2), a > 0: directly, and for large a by the
 * asymptotic series of Gamma(a + 1/2) / (sqrt(a) Gamma(a)) (DLMF 5.11.13),
 * whose first omitted term is below 4e-14 for a >= 32. */
static double gamma_ratio(double a)
{
	static const double c[] = { 869. / 4194304, -399. / 262144, -21. / 32768,
		5. / 1024, 1. / 128, -1. / 8, 1 };
	double s = 0;

	if (a < 32)
		return tgamma(a + 1) / tgamma(a + .5);
	for (size_t i = 0; i < sizeof c / sizeof *c; i++)
		s = s / a + c[i];
	return sqrt(a) / s;
}

/* sum over j of (p + 1/2)_j / (q + 1)_j z^j: what DLMF 8.17.8 leaves of the
 * incomplete beta function. Positive terms, so nothing cancels. */
static double beta_series(double p, double q, double z)
{
	double term = 1, sum = 1;

	for (int j = 0; term > 1e-16 * sum; j++) {
		term *= z * (p + .5 + j) / (q + 1 + j);
		sum += term;
	}
	return sum;
}

double bsdf_lobe_normaliser(double k, double cos_theta)
{
	double whole = 2 * PI / (k + 1), a = .5 * (k + 1);
	double y = cos_theta * cos_theta, x = 1 - y;

	if (k == 1)
		return .5 * PI * (1 + cos_theta);
	if (cos_theta <= 0)
		return .5 * whole;
	if (x <= 0)
		return whole;
	if (k == 0)
		return 2 * (PI - acos(cos_theta));
	/* I(x; a, 1/2) <= x^a / cos theta, because the series' terms are below x^j. It counts
	 * for nothing below e^-34 = 2e-15. */
	double exponent = a * log1p(-y);
	if (exponent < -34 + log(cos_theta))
		return whole;
	/* x^a (1-x)^(1/2) / (a B(a, 1/2)); the series of I about the nearer end. */
	double power = exp(exponent) * cos_theta / (sqrt(PI) * gamma_ratio(a));
	if (x < .5)
		return whole * (1 - .5 * power * beta_series(a, a, x));
	return whole * .5 * (1 + 2 * a * power * beta_series(a, .5, y));
}

/* Mean over psi of clamp((A + B cos psi) / c, 0, 1), B >= 0. */
static double clamped_mean(double A, double B, double c)
{
	if (A - B >= 0 && A + B <= c)
		return A / c;
	double full = A + B <= c ? 0 : A - B >= c ? PI : acos((c - A) / B);
	double none = A + B <= 0 ? 0 : A - B >= 0 ? PI : acos(-A / B);
	double width = none - full, slope;
	/* Radians. Above, the difference cancels to 1e-13; below, Simpson's rule errs by
	 * width^4 / 2880. */
	if (width > 1e-3) {
		slope = (A * width + B * (sin(none) - sin(full))) / c;
	} else {
		double middle = (A + B * cos(.5 * (none + full))) / c;
		slope = width / 6 * (1 + 4 * fmin(fmax(middle, 0), 1));
	}
	return (full + slope) / PI;
}

/* Integral of (k+1) cos^k g sin g clamped_mean over g from lo to hi by the
 * double-exponential rule of Takahasi & Mori 1974, which the square-root kinks
 * at both ends do not hurt. */
static double albedo_piece(double k, double c, double s, double lo, double hi)
{
	/* A count of steps to each side, over which t comes to 3.2, where the rule's weights have
	 * fallen to 1e-16: a guess, with which unit test lobe finds errors below 1e-6. */
	enum { HALF = 48 };
	const double step = 3.2 / HALF;
	double sum = 0;

	if (!(hi > lo))
		return 0;
	for (int i = -HALF; i <= HALF; i++) {
		double t = i * step, q = .5 * PI * sinh(t);
		double g = lo + (hi - lo) / (1 + exp(-2 * q));
		double cosine = cos(g), sine = sin(g);
		double jacobian = .25 * PI * cosh(t) / (cosh(q) * cosh(q));
		sum += jacobian * (k + 1) * bsdf_lobe_power(k, cosine) * sine *
		       clamped_mean(cosine * c, sine * s, c);
	}
	return sum * step * (hi - lo);
}

double bsdf_lobe_albedo(double k, double cos_theta)
{
	double c = fmin(fmax(cos_theta, 1e-12), 1), s = sqrt(1 - c * c), theta = acos(c);
	/* cos^(k+1) of the last angle is e^-40 = 4e-18: less than rounding is left beyond. */
	double end = acos(exp(-40 / (k + 1)));
	double twice = fmin(2 * theta, end), horizon = fmin(.5 * PI - theta, end);
	double first = fmin(twice, horizon), second = fmax(twice, horizon);

	return albedo_piece(k, c, s, 0, first) + albedo_piece(k, c, s, first, second) +
	       albedo_piece(k, c, s, second, end);
}

static void in_frame(const double axis[3], double sine, double cosine, double phi,
                     double out[3])
{
	double t[3], b[3], x = cos(phi), y = sin(phi);

	v3_frame(axis, t, b);
	for (int i = 0; i < 3; i++)
		out[i] = sine * (x * t[i] + y * b[i]) + cosine * axis[i];
}

void bsdf_lobe_sample_whole(double k, const double axis[3], const double u[2], double out[3])
{
	/* cos^(k+1) is uniform; the sine without cancellation for large k. */
	double l = log1p(-u[0]) / (k + 1);

	in_frame(axis, sqrt(-expm1(2 * l)), exp(l), 2 * PI * u[1], out);
}

void bsdf_lobe_sample(double k, const double axis[3], const double n[3], const double u[2],
                      double out[3])
{
	/* A count. At least half of the lobe is above the horizon: all miss once in 2^64. */
	enum { TRIES = 64 };
	uint64_t bits[2];
	struct rng r;

	bsdf_lobe_sample_whole(k, axis, u, out);
	if (v3_dot(n, out) > 0)
		return;
	memcpy(bits, u, sizeof bits);
	r = rng_seed(bits[0], bits[1]);
	for (int i = 0; i < TRIES && v3_dot(n, out) <= 0; i++) {
		double v[2] = { rng_uniform(&r), rng_uniform(&r) };
		bsdf_lobe_sample_whole(k, axis, v, out);
	}
	if (v3_dot(n, out) <= 0) /* an axis on the horizon but for rounding */
		v3_mad(out, -2 * v3_dot(n, out), n, out);
}

double bsdf_lobe_scatter(enum lobe_kind kind, double k, const double axis[3], const double n[3],
                         const double u[2], double out[3])
{
	if (kind == LOBE_PAPER) {
		bsdf_lobe_sample(k, axis, n, u, out);
		return 1;
	}
	bsdf_lobe_sample_whole(k, axis, u, out);
	double ci = v3_dot(axis, n), co = v3_dot(out, n);
	return co <= 0 ? 0 : co / fmax(ci, co);
}

void bsdf_sample_cosine(const double n[3], const double u[2], double out[3])
{
	in_frame(n, sqrt(u[0]), sqrt(1 - u[0]), 2 * PI * u[1], out);
}

void bsdf_lobe_mirror(const double l[3], const double n[3], double out[3])
{
	double twice = 2 * v3_dot(n, l);

	for (int i = 0; i < 3; i++)
		out[i] = twice * n[i] - l[i];
}
