/* Poses of the tools and of the deputy, as rows of position and quaternion x y z w.
 *
 * A pose that the generated functions give is a rotation, row by row, and an origin: 12 numbers. ARMS is the
 * number of arms.
 */
#include <math.h>

#define POSE 12
#define POSE_ROW 7
#define TWIST 6

static void row_of(const double *pose, double *row) {
  static const int next[3] = {1, 2, 0};
  const double *R = pose;
  double *q = row + 3, trace = R[0] + R[4] + R[8];
  memcpy(row, pose + 9, 3 * sizeof *row);
  if (trace > 0.0) {
    double root = sqrt(trace + 1.0), scale = 0.5 / root;
    q[3] = 0.5 * root;
    q[0] = (R[7] - R[5]) * scale, q[1] = (R[2] - R[6]) * scale, q[2] = (R[3] - R[1]) * scale;
  } else { /* about the axis on which the rotation has its largest part, so that nothing cancels */
    int i = R[4] > R[0] ? 1 : 0;
    if (R[8] > R[4 * i]) i = 2;
    int j = next[i], k = next[j];
    double root = sqrt(R[4 * i] - R[4 * j] - R[4 * k] + 1.0), scale = 0.5 / root;
    q[i] = 0.5 * root;
    q[3] = (R[3 * k + j] - R[3 * j + k]) * scale;
    q[j] = (R[3 * j + i] + R[3 * i + j]) * scale;
    q[k] = (R[3 * k + i] + R[3 * i + k]) * scale;
  }
}

static void pose_of(const double *row, double *pose) {
  double x = row[3], y = row[4], z = row[5], w = row[6];
  double length = sqrt(x * x + y * y + z * z + w * w);
  x /= length, y /= length, z /= length, w /= length;
  pose[0] = 1.0 - 2.0 * (y * y + z * z), pose[1] = 2.0 * (x * y - w * z), pose[2] = 2.0 * (x * z + w * y);
  pose[3] = 2.0 * (x * y + w * z), pose[4] = 1.0 - 2.0 * (x * x + z * z), pose[5] = 2.0 * (y * z - w * x);
  pose[6] = 2.0 * (x * z - w * y), pose[7] = 2.0 * (y * z + w * x), pose[8] = 1.0 - 2.0 * (x * x + y * y);
  memcpy(pose + 9, row, 3 * sizeof *row);
}

/* Row of what is fixed to a body, at the pose `in_body`. */
static void placed(const double *body, const double *in_body, double *row) {
  double A[POSE], pose[POSE];
  const double *B = in_body;
  pose_of(body, A);
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++)
      pose[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j];
    pose[9 + i] = A[9 + i] + (A[3 * i] * B[9] + A[3 * i + 1] * B[10] + A[3 * i + 2] * B[11]);
  }
  row_of(pose, row);
}

void sms_placed(const double *body, const double *in_body, double *row, double *w) {
  (void)w;
  placed(body, in_body, row);
}

/* Rows (ARMS, 7) of the tools at q. */
void sms_tool_rows(const double *q, const double *parameters, double *rows, double *w) {
  double poses[ARMS * POSE];
  const double *arguments[ARGUMENTS] = {q, parameters};
  double *results[ARGUMENTS] = {poses};
  sms_tools(arguments, results, 0, w, 0);
  for (int arm = 0; arm < ARMS; arm++) row_of(poses + POSE * arm, rows + POSE_ROW * arm);
}

/* Rows (ARMS, 7) and twists (ARMS, 6) of the tools. With a holder >= 0 also row and twist of the deputy,
 * whose pose in the tool is `in_tool`: it moves with the tool as one body. */
void sms_motion_rows(const double *q, const double *v, const double *parameters, long holder,
                     const double *in_tool, double *rows, double *twists, double *deputy, double *deputy_twist,
                     double *w) {
  double poses[ARMS * POSE];
  const double *arguments[ARGUMENTS] = {q, v, parameters};
  double *results[ARGUMENTS] = {poses, twists};
  sms_motion(arguments, results, 0, w, 0);
  for (int arm = 0; arm < ARMS; arm++) row_of(poses + POSE * arm, rows + POSE_ROW * arm);
  if (holder < 0) return;
  const double *A = poses + POSE * holder, *B = in_tool, *twist = twists + TWIST * holder, *spin = twist + 3;
  double pose[POSE], lever[3];
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++)
      pose[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] + A[3 * i + 2] * B[6 + j];
    lever[i] = A[3 * i] * B[9] + A[3 * i + 1] * B[10] + A[3 * i + 2] * B[11];
    pose[9 + i] = A[9 + i] + lever[i];
  }
  row_of(pose, deputy);
  deputy_twist[0] = twist[0] + (spin[1] * lever[2] - spin[2] * lever[1]);
  deputy_twist[1] = twist[1] + (spin[2] * lever[0] - spin[0] * lever[2]);
  deputy_twist[2] = twist[2] + (spin[0] * lever[1] - spin[1] * lever[0]);
  memcpy(deputy_twist + 3, spin, 3 * sizeof *spin);
}
