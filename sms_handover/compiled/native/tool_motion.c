/* Motion of the tools: paths from pose to pose, and joint rates that give desired twists.
 *
 * As in trajectory/tool_motion.py and trajectory/pose_path.py.
 */

/* Rotation by a rotation vector, by Rodrigues' formula. */
static void exponential(const double *v, double *R) {
  double square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2], angle = sqrt(square), s, c;
  if (angle < SMALL_ANGLE) {
    s = 1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0 - square / 5040.0));
    c = 0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square / 40320.0));
  } else {
    double half = sin(0.5 * angle);
    s = sin(angle) / angle, c = 2.0 * half * half / square;
  }
  double x = v[0], y = v[1], z = v[2];
  R[0] = 1.0 - c * (y * y + z * z), R[1] = c * x * y - s * z, R[2] = c * x * z + s * y;
  R[3] = c * x * y + s * z, R[4] = 1.0 - c * (x * x + z * z), R[5] = c * y * z - s * x;
  R[6] = c * x * z - s * y, R[7] = c * y * z + s * x, R[8] = 1.0 - c * (x * x + y * y);
}

/* Row (7) and twist (6) on the straight line and shortest rotation between two poses, at a fraction of the way
 * and its rate; all of the way is the end itself. */
static void on_path(const double *start, const double *goal, double fraction, double rate, double *row,
                    double *twist) {
  if (fraction == 1.0 && rate == 0.0) {
    memcpy(row, goal, POSE_ROW * sizeof *row);
    for (int i = 0; i < TWIST; i++) twist[i] = 0.0;
    return;
  }
  double A[POSE], B[POSE], M[9], turn[3], part[3], E[9], pose[POSE];
  pose_of(start, A), pose_of(goal, B);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) M[3 * i + j] = A[i] * B[j] + A[3 + i] * B[3 + j] + A[6 + i] * B[6 + j];
  logarithm(M, turn);
  for (int i = 0; i < 3; i++) part[i] = fraction * turn[i];
  exponential(part, E);
  for (int i = 0; i < 3; i++) {
    double way = B[9 + i] - A[9 + i];
    for (int j = 0; j < 3; j++)
      pose[3 * i + j] = A[3 * i] * E[j] + A[3 * i + 1] * E[3 + j] + A[3 * i + 2] * E[6 + j];
    pose[9 + i] = A[9 + i] + fraction * way;
    twist[i] = rate * way;
    twist[3 + i] = rate * (A[3 * i] * turn[0] + A[3 * i + 1] * turn[1] + A[3 * i + 2] * turn[2]);
  }
  row_of(pose, row);
}

void sms_on_path(const double *start, const double *goal, const double *progress, double *row, double *twist,
                 double *w) {
  (void)w;
  on_path(start, goal, progress[0], progress[1], row, twist);
}

/* Take from the twists (ARMS, 6) in world of the arms that are led what the momentum gives their tools anyway. */
void sms_without_drift(const double *q, const double *v, const double *parameters, const long long *led,
                       double *twists, double *w) {
  double carried[ARMS * TWIST];
  const double *arguments[ARGUMENTS] = {q, v, parameters};
  double *results[ARGUMENTS] = {carried};
  sms_carried(arguments, results, 0, w, 0);
  for (int i = 0; i < ARMS * TWIST; i++)
    if (led[i / TWIST]) twists[i] -= carried[i];
}

/* Change the rates (N) of the arms that are led so that their tools have twists (ARMS, 6) in world, with the
 * reaction of the base: the damped inverse of the generalised Jacobian. */
void sms_resolve_rates(const double *q, const double *parameters, const double *twists, const long long *led,
                       const double *damping, double *rates, double *w) {
  enum { MOST = ARMS * ROWS };
  double jacobian[MOST * N], A[MOST][MOST], x[MOST];
  int columns[N], rows[MOST], n = 0, m = 0;
  const double *arguments[ARGUMENTS] = {q, parameters};
  double *results[ARGUMENTS] = {jacobian};
  sms_generalized_jacobian(arguments, results, 0, w, 0);
  for (int arm = 0; arm < ARMS; arm++) {
    if (!led[arm]) continue;
    for (int j = 0; j < arm_joints[arm]; j++) columns[n++] = first_joint[arm] + j;
    for (int i = 0; i < ROWS; i++) rows[m++] = ROWS * arm + i;
  }
  for (int i = 0; i < m; i++) {
    const double *row = jacobian + N * rows[i];
    x[i] = twists[rows[i]];
    for (int j = 0; j < N; j++) x[i] -= row[j] * rates[j]; /* the other arms move the tool through the base */
    for (int k = 0; k <= i; k++) {
      double sum = i == k ? damping[0] * damping[0] : 0.0;
      for (int j = 0; j < n; j++) sum += row[columns[j]] * jacobian[N * rows[k] + columns[j]];
      A[i][k] = sum;
    }
  }
  for (int j = 0; j < m; j++) { /* Cholesky, with the inverse of the diagonal in its place */
    double sum = A[j][j];
    for (int k = 0; k < j; k++) sum -= A[j][k] * A[j][k];
    A[j][j] = 1.0 / sqrt(sum);
    for (int i = j + 1; i < m; i++) {
      double entry = A[i][j];
      for (int k = 0; k < j; k++) entry -= A[i][k] * A[j][k];
      A[i][j] = entry * A[j][j];
    }
  }
  for (int i = 0; i < m; i++) {
    for (int k = 0; k < i; k++) x[i] -= A[i][k] * x[k];
    x[i] *= A[i][i];
  }
  for (int i = m - 1; i >= 0; i--) {
    for (int k = i + 1; k < m; k++) x[i] -= A[k][i] * x[k];
    x[i] *= A[i][i];
  }
  for (int j = 0; j < n; j++) {
    double sum = 0.0;
    for (int i = 0; i < m; i++) sum += jacobian[N * rows[i] + columns[j]] * x[i];
    rates[columns[j]] = sum;
  }
}
