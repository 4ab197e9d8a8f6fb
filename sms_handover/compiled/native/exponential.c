/* Exponential function of our own: the same bits on every machine, and no branch, so that loops are vectorised.
 *
 * Reduction by multiples of ln 2 in two parts [Cody1980], then the series to the order 13 on [-ln 2 / 2, ln 2 / 2].
 * For x in [-700, 0] the error is below 2 ulp; below it is 0.
 */
SMS_INLINE double sms_exp(double x) {
  const double to_integer = 6755399441055744.0; /* 1.5 * 2^52, as for the sine */
  double kept = x < -700.0 ? -700.0 : x;
  double shifted = kept * 1.44269504088896338700 + to_integer, n = shifted - to_integer;
  double r = (kept - n * 6.93147180369123816490e-01) - n * 1.90821492927058770002e-10, p = 1.0 / 6227020800.0;
  p = p * r + 1.0 / 479001600.0, p = p * r + 1.0 / 39916800.0, p = p * r + 1.0 / 3628800.0;
  p = p * r + 1.0 / 362880.0, p = p * r + 1.0 / 40320.0, p = p * r + 1.0 / 5040.0, p = p * r + 1.0 / 720.0;
  p = p * r + 1.0 / 120.0, p = p * r + 1.0 / 24.0, p = p * r + 1.0 / 6.0, p = p * r + 0.5, p = p * r + 1.0;
  p = p * r + 1.0;
  long long bits;
  memcpy(&bits, &shifted, sizeof bits);
  bits = ((bits + 1023) & 0x7ff) << 52; /* 2^n */
  double scale;
  memcpy(&scale, &bits, sizeof scale);
  return x < -700.0 ? 0.0 : x == x ? p * scale : x;
}
