/* Sine and cosine of our own: the same bits on every machine, and no branch, so that loops can be vectorised.
 *
 * Angle reduction by multiples of pi/2 in three parts [Cody1980], polynomials of fdlibm on [-pi/4, pi/4]. For
 * |x| < 1e5 rad the error is below 1 ulp; beyond it grows, and what is no number stays none.
 */
#include <math.h>
#include <string.h>

#define SMS_INLINE static inline __attribute__((always_inline))

/* Sine or cosine: the number of quarter turns, odd or even, says which polynomial is taken. */
SMS_INLINE double sms_turned(double x, long long quarter) {
  const double to_integer = 6755399441055744.0; /* 1.5 * 2^52: what is added is rounded, its last bits count */
  const double first = 1.57079632673412561417e+00, second = 6.07710050630396597660e-11,
               third = 2.02226624879595063154e-21; /* pi/2 in two parts of 33 bits and the rest */
  double shifted = x * 0.63661977236758134308 + to_integer, n = shifted - to_integer;
  long long k;
  memcpy(&k, &shifted, sizeof k);
  k += quarter;
  double a = x - n * first, b = n * second, c = a - b;
  double d = n * third - ((a - c) - b), y = c - d, rest = (c - y) - d, z = y * y;
  double p = z * (z * (z * (z * 1.58969099521155010221e-10 - 2.50507602534068634195e-08) +
                       2.75573137070700676789e-06) - 1.98412698298579493134e-04) + 8.33333333332248946124e-03;
  double cube = z * y;
  double sine = y - ((z * (0.5 * rest - cube * p) - rest) + cube * 1.66666666666666324348e-01);
  double r = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 +
             z * (2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 +
             z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
  double half = 0.5 * z, near = 1.0 - half;
  double cosine = near + (((1.0 - near) - half) + (z * r - y * rest));
  long long s, t, odd = -(k & 1);
  memcpy(&s, &sine, sizeof s), memcpy(&t, &cosine, sizeof t);
  s = ((t & odd) | (s & ~odd)) ^ ((k >> 1) << 63);
  double found;
  memcpy(&found, &s, sizeof found);
  return found;
}

SMS_INLINE double sms_sin(double x) { return sms_turned(x, 0); }
SMS_INLINE double sms_cos(double x) { return sms_turned(x, 1); }

/* For tests: sine and cosine of some angles. */
void sms_sines_cosines(const double *x, double *sines, double *cosines, long count, double *w) {
  (void)w;
  for (long k = 0; k < count; k++) sines[k] = sms_sin(x[k]), cosines[k] = sms_cos(x[k]);
}

#define sin sms_sin
#define cos sms_cos
