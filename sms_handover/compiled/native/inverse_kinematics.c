/* Inverse kinematics with the base locked: the iterations of ik/levenberg_marquardt.py, arm by arm.
 *
 * As no joint moves two tools, J J^T has a block of (6, 6) for each arm that is led by its tool. FIRST_JOINTS
 * and ARM_JOINTS are the joints of each arm, MOST_JOINTS the largest number.
 */
#define ROWS 6                /* of the residual of a tool: position, orientation */
#define DAMPING_GROWTH 2.5    /* [-] as in ik/levenberg_marquardt.py */
#define MAX_GROWTHS 40        /* [-] */
#define SMALL_ANGLE 1e-2      /* [rad] below, four terms of a series leave less than rounding */
#define SMALL_SINE 1e-8       /* [-] below, the sine of an angle is the angle */

enum { CONVERGED = 0, STALLED = 1, ITERATION_LIMIT = 2 };

/* All fields have 8 bytes; compiled/inverse_kinematics.py has the same order. */
typedef struct {
  double lower[N], upper[N];                                        /* rad */
  double position_tolerance, orientation_tolerance, damping_bias, stall_step; /* m, rad, -, rad */
  long long max_iterations;
} ik_settings_t;

typedef struct {
  double values[ARMS * ROWS], angle[ARMS], position_error, orientation_error, energy;
  double linear[3 * N], angular[3 * N]; /* Jacobians, three numbers per joint of an arm after the other */
} residual_t;

/* The solution at the start is the seed. */
typedef struct {
  double joints[N], values[ARMS * ROWS], position_error, orientation_error, energy;
  long long status, iterations;
} ik_solution_t;

static const int first_joint[ARMS] = FIRST_JOINTS, arm_joints[ARMS] = ARM_JOINTS;

static double within(double value, double low, double high) {
  if (value < low) return low;
  if (value > high) return high;
  return value; /* NaN too, as in NumPy */
}

/* Rotation vector of a rotation by its quaternion, so that half a turn is no exception. */
static double logarithm(const double *R, double *vector) {
  double pose[POSE] = {R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]}, row[POSE_ROW];
  row_of(pose, row);
  double x = row[3], y = row[4], z = row[5], c = row[6];
  if (c < 0.0) x = -x, y = -y, z = -z, c = -c;
  double s = sqrt(x * x + y * y + z * z), scale = s < SMALL_SINE ? 2.0 / c : 2.0 * atan2(s, c) / s;
  vector[0] = scale * x, vector[1] = scale * y, vector[2] = scale * z;
  return scale * s;
}

static void evaluate(const double *base, const double *parameters, const double *joints, const double *targets,
                     const long long *led, residual_t *r, double *w) {
  double q[NQ], poses[ARMS * POSE], sum = 0.0;
  memcpy(q, base, 7 * sizeof *q), memcpy(q + 7, joints, N * sizeof *q);
  const double *arguments[ARGUMENTS] = {q, parameters};
  double *results[ARGUMENTS] = {poses, r->linear, r->angular};
  sms_tool_jacobians(arguments, results, 0, w, 0);
  r->position_error = r->orientation_error = 0.0;
  for (int arm = 0; arm < ARMS; arm++) {
    double *e = r->values + ROWS * arm, M[9];
    if (!led[arm]) {
      for (int i = 0; i < ROWS; i++) e[i] = 0.0;
      continue;
    }
    const double *R = poses + POSE * arm, *D = targets + POSE * arm;
    for (int i = 0; i < 3; i++) {
      for (int j = 0; j < 3; j++) M[3 * i + j] = D[i] * R[j] + D[3 + i] * R[3 + j] + D[6 + i] * R[6 + j];
      e[i] = R[9 + i] - D[9 + i];
    }
    r->angle[arm] = logarithm(M, e + 3);
    double way = sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
    double turn = sqrt(e[3] * e[3] + e[4] * e[4] + e[5] * e[5]);
    if (way > r->position_error || way != way) r->position_error = way;
    if (turn > r->orientation_error || turn != turn) r->orientation_error = turn;
    for (int i = 0; i < ROWS; i++) sum += e[i] * e[i];
  }
  r->energy = 0.5 * sum;
}

static int has_converged(const residual_t *r, const ik_settings_t *s) {
  return r->energy < INFINITY && r->position_error <= s->position_tolerance &&
         r->orientation_error <= s->orientation_tolerance;
}

/* Solve A x = b for the lower half of a positive definite A, in place. */
static void solve(double A[ROWS][ROWS], double *x) {
  for (int j = 0; j < ROWS; j++) {
    double sum = A[j][j];
    for (int k = 0; k < j; k++) sum -= A[j][k] * A[j][k];
    A[j][j] = 1.0 / sqrt(sum);
    for (int i = j + 1; i < ROWS; i++) {
      double entry = A[i][j];
      for (int k = 0; k < j; k++) entry -= A[i][k] * A[j][k];
      A[i][j] = entry * A[j][j];
    }
  }
  for (int i = 0; i < ROWS; i++) {
    for (int k = 0; k < i; k++) x[i] -= A[i][k] * x[k];
    x[i] *= A[i][i];
  }
  for (int i = ROWS - 1; i >= 0; i--) {
    for (int k = i + 1; k < ROWS; k++) x[i] -= A[k][i] * x[k];
    x[i] *= A[i][i];
  }
}

/* Jacobian of the residual of one tool, with zeros at joints that the step would push through a limit.
 * The derivative of the logarithm is 1 + [w]/2 + c [w]^2. */
static void jacobian_of(const residual_t *r, const double *joints, const ik_settings_t *s, int arm,
                        double J[ROWS][MOST_JOINTS]) {
  const double *e = r->values + ROWS * arm;
  double x = e[3], y = e[4], z = e[5], angle = r->angle[arm], square = angle * angle;
  double c = angle < SMALL_ANGLE
                 ? 1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0 + square / 1209600.0))
                 : 1.0 / square - (1.0 + cos(angle)) / (2.0 * angle * sin(angle));
  double K[3][3] = {{1.0 - c * (y * y + z * z), -0.5 * z + c * x * y, 0.5 * y + c * x * z},
                    {0.5 * z + c * x * y, 1.0 - c * (x * x + z * z), -0.5 * x + c * y * z},
                    {-0.5 * y + c * x * z, 0.5 * x + c * y * z, 1.0 - c * (x * x + y * y)}};
  for (int j = 0; j < arm_joints[arm]; j++) {
    int joint = first_joint[arm] + j;
    const double *moved = r->linear + 3 * joint, *turned = r->angular + 3 * joint;
    for (int i = 0; i < 3; i++) {
      J[i][j] = moved[i];
      J[3 + i][j] = K[i][0] * turned[0] + K[i][1] * turned[1] + K[i][2] * turned[2];
    }
    int at_lower = joints[joint] <= s->lower[joint], at_upper = joints[joint] >= s->upper[joint];
    if (!at_lower && !at_upper) continue;
    double gradient = 0.0;
    for (int i = 0; i < ROWS; i++) gradient += e[i] * J[i][j];
    if ((at_lower && gradient > 0.0) || (at_upper && gradient < 0.0))
      for (int i = 0; i < ROWS; i++) J[i][j] = 0.0;
  }
}

/* Find the first damped step that lowers the energy; return whether there is one. */
static int descend(const double *base, const double *parameters, const double *joints, const residual_t *r,
                   const double *targets, const long long *led, const ik_settings_t *s, double *candidate,
                   residual_t *found, double *w) {
  double J[ARMS][ROWS][MOST_JOINTS], undamped[ARMS][ROWS][ROWS], damped[ROWS][ROWS], growth = 1.0;
  for (int arm = 0; arm < ARMS; arm++) {
    if (!led[arm]) continue;
    jacobian_of(r, joints, s, arm, J[arm]);
    for (int i = 0; i < ROWS; i++)
      for (int k = 0; k <= i; k++) {
        double sum = 0.0;
        for (int j = 0; j < arm_joints[arm]; j++) sum += J[arm][i][j] * J[arm][k][j];
        undamped[arm][i][k] = sum;
      }
  }
  for (int count = 0; count < MAX_GROWTHS; count++, growth *= DAMPING_GROWTH) {
    double damping = r->energy + s->damping_bias * growth;
    memcpy(candidate, joints, N * sizeof *candidate);
    for (int arm = 0; arm < ARMS; arm++) {
      if (!led[arm]) continue;
      double x[ROWS];
      memcpy(damped, undamped[arm], sizeof damped);
      for (int i = 0; i < ROWS; i++) damped[i][i] += damping, x[i] = r->values[ROWS * arm + i];
      solve(damped, x);
      for (int j = 0; j < arm_joints[arm]; j++) {
        int joint = first_joint[arm] + j;
        double step = 0.0;
        for (int i = 0; i < ROWS; i++) step += x[i] * J[arm][i][j];
        candidate[joint] = within(joints[joint] - step, s->lower[joint], s->upper[joint]);
      }
    }
    evaluate(base, parameters, candidate, targets, led, found, w);
    if (found->energy < r->energy) return 1;
  }
  return 0;
}

/* Bring the tools that are led to their targets (ARMS, 12) in world, or nearest from the seed. */
static void find_joints(const double *base, const double *parameters, const double *targets, const long long *led,
                        const ik_settings_t *s, ik_solution_t *solution, double *w) {
  residual_t first, second, *r = &first, *found = &second, *other;
  double candidate[N], *joints = solution->joints;
  long long k;
  for (int j = 0; j < N; j++) joints[j] = within(joints[j], s->lower[j], s->upper[j]);
  evaluate(base, parameters, joints, targets, led, r, w);
  solution->status = ITERATION_LIMIT;
  for (k = 0; k < s->max_iterations; k++) {
    if (has_converged(r, s)) break;
    double largest = 0.0;
    if (descend(base, parameters, joints, r, targets, led, s, candidate, found, w))
      for (int j = 0; j < N; j++) {
        double moved = fabs(candidate[j] - joints[j]);
        if (moved > largest) largest = moved;
      }
    if (largest <= s->stall_step) {
      solution->status = STALLED;
      break;
    }
    memcpy(joints, candidate, sizeof candidate);
    other = r, r = found, found = other;
  }
  if (solution->status != STALLED && has_converged(r, s)) solution->status = CONVERGED;
  solution->iterations = k;
  memcpy(solution->values, r->values, sizeof r->values);
  solution->position_error = r->position_error, solution->orientation_error = r->orientation_error;
  solution->energy = r->energy;
}

/* The same for targets that are rows (ARMS, 7). */
void sms_find_joints(const double *base, const double *parameters, const double *rows, const long long *led,
                     const ik_settings_t *s, ik_solution_t *solution, double *w) {
  double targets[ARMS * POSE];
  for (int arm = 0; arm < ARMS; arm++)
    if (led[arm]) pose_of(rows + POSE_ROW * arm, targets + POSE * arm);
  find_joints(base, parameters, targets, led, s, solution, w);
}
