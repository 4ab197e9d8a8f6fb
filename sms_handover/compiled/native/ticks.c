/* Ticks: the loop of simulation/period_runner.py in C, with the same operations in the same order.
 *
 * Included behind the functions that CasADi has generated for a kind of robot, and behind the definitions of
 *   N, NQ, NV   number of joints, and of entries of q and v
 *   PER_BODY    number of inertial parameters of a body
 *   LOADED      functions of the law where truth and model differ in what an arm carries, by its number
 *   TOOL_BODIES bodies that have the tools
 *   ARGUMENTS   most pointers that a generated function needs room for
 * No operation may be fused or reordered (-ffp-contract=off), so that the two loops agree bit for bit.
 */
enum { LAW_NMPC = 0, LAW_PID = 1 };

/* All fields have 8 bytes: Python sees them as one array (compiled/ticks.py has the same order). */
typedef struct ticks {
  double q[NQ], v[NV], effort[N];       /* state, and the efforts that acted up to it */
  double motion[3][N];                  /* q_d rad, q_d' rad/s, q_d'' rad/s^2 at the last reference */
  double gains[3];                      /* nmpc: A_1, A_2; pid: K_P, K_I, K_D */
  double integral[N];                   /* rad s, of pid */
  double limit[N];                      /* N m, of the joints as the law knows them */
  double true_limit[N];                 /* N m, of the joints as they are */
  double tick_s, work;                  /* s, J */
  long long stamp_ns, reference_ns, longest_ns, tick_ns, law;
  long long one_robot, loaded;          /* truth and model alike; but for what this arm carries, -1: for more */
  const double *true_parameters, *known_parameters;
  effects_t *effects;                   /* of conditions that are not ideal, or 0 */
  function_t efforts_of_model;          /* what the law computes by the model, whose joints may be elsewhere */
  void (*ticks_of_truth)(struct ticks *, long, double *, long, long, double *);
  void (*observe_truth)(const struct ticks *, void *, void *, double *);
  long long saturated[N];
} ticks_t;

static void desired_motion(const ticks_t *t, double (*desired)[N]) {
  long long age_ns = t->stamp_ns - t->reference_ns;
  int old = t->longest_ns >= 0 && age_ns > t->longest_ns;
  double s = (double)(old ? t->longest_ns : age_ns) / NS_PER_S, half = 0.5 * s * s;
  int still = 1;
  for (int j = 0; j < N; j++)
    if (t->motion[1][j] != 0.0 || t->motion[2][j] != 0.0) still = 0;
  for (int j = 0; j < N; j++) {
    double q = t->motion[0][j], rate = t->motion[1][j], acceleration = t->motion[2][j];
    desired[0][j] = still ? q : q + s * rate + half * acceleration;
    desired[1][j] = still ? rate : rate + s * acceleration + half * 0.0;
    desired[2][j] = still ? acceleration : acceleration + s * 0.0 + half * 0.0;
    if (old) desired[1][j] = desired[2][j] = 0.0;
  }
}

/* Joint accelerations that the law asks for, from a desired motion (3, n). */
static void ask(const double *q, const double *v, const double *desired, const double *gains, double *asked) {
  for (int j = 0; j < N; j++) {
    double error = q[7 + j] - desired[j], error_rate = v[6 + j] - desired[N + j];
    asked[j] = desired[2 * N + j] - gains[0] * error - gains[1] * error_rate;
  }
}

/* Efforts that bring them about, for Python: `desired`, gains A_1 and A_2. */
void sms_computed_torque(const double *q, const double *v, const double *desired, const double *gains,
                         const double *parameters, double *efforts, double *w) {
  double turn[2][N], asked[N];
  turns_at(q, turn), ask(q, v, desired, gains, asked);
  const double *arguments[ARGUMENTS] = {turn[0], turn[1], v, asked, parameters};
  double *results[ARGUMENTS] = {efforts};
  sms_efforts(arguments, results, 0, w, 0);
}

static double sign(double x) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : x; }

/* Whether the law works out what the step keeps of its first stage. */
static int is_prepared(const ticks_t *t) {
  return t->law == LAW_NMPC && (t->one_robot || t->loaded >= 0) && !resists(t->effects);
}

/* Efforts of the law; where truth and model share most of it, also what the step keeps of its first stage. */
static void efforts_of(ticks_t *t, int prepared, double (*desired)[N], double (*turn)[N], double *efforts, double *kept,
                       double *w) {
  if (t->law == LAW_NMPC) {
    /* CasADi has columns where NumPy has rows: (3, n) in memory is its (n, 3) */
    static const function_t loaded[] = LOADED;
    static const int tool_bodies[] = TOOL_BODIES;
    const double *arguments[ARGUMENTS] = {t->q, t->v, desired[0], t->gains, t->known_parameters};
    double *results[ARGUMENTS] = {efforts, kept};
    if (prepared && t->one_robot)
      sms_prepared_torque(arguments, results, 0, w, 0);
    else if (prepared) {
      int own = PER_BODY * tool_bodies[t->loaded];
      arguments[5] = t->true_parameters + own, arguments[6] = t->known_parameters + own;
      loaded[t->loaded](arguments, results, 0, w, 0);
    } else {
      double asked[N];
      ask(t->q, t->v, desired[0], t->gains, asked);
      const double *given[ARGUMENTS] = {turn[0], turn[1], t->v, asked, t->known_parameters};
      t->efforts_of_model(given, results, 0, w, 0);
    }
    for (int j = 0; j < N; j++) efforts[j] = clipped(efforts[j], t->limit[j]);
    return;
  }
  for (int j = 0; j < N; j++) {
    double error = t->q[7 + j] - desired[0][j], rate = t->v[6 + j] - desired[1][j];
    double wanted = -(t->gains[0] * error + t->gains[1] * t->integral[j] + t->gains[2] * rate);
    efforts[j] = clipped(wanted, t->limit[j]);
    int winds_up = wanted != efforts[j] && sign(wanted) == -sign(error);
    t->integral[j] += winds_up ? 0.0 : error * t->tick_s;
  }
}

const long long sms_work_size = WORK;

/* Carry out `ticks` ticks, of which `steps` are integrated; write a row of q, v, effort and command each. */
void sms_ticks(ticks_t *t, long scheme, double *rows, long ticks, long steps, double *w) {
  static const function_t schemes[] = STEPS, rests[] = RESTS;
  effects_t *e = t->effects;
  int prepared = is_prepared(t), resisted = resists(e), open = 0; /* whether the account of a step is open */
  int turning = resisted || (t->law == LAW_NMPC && !prepared);
  double kept[KEPT], numbers[NUMBERS], turn[2][N];
  double desired[3][N], command[N], acted[N], force[NV] = {0.0}, q[NQ], v[NV];
  for (long k = 0; k < ticks; k++) {
    desired_motion(t, desired);
    if (turning) turns_at(t->q, turn);
    efforts_of(t, prepared, desired, turn, command, kept, w);
    memcpy(rows, t->q, sizeof t->q), rows += NQ;
    memcpy(rows, t->v, sizeof t->v), rows += NV;
    memcpy(rows, t->effort, sizeof t->effort), rows += N;
    memcpy(rows, command, sizeof command), rows += N;
    if (k == steps) break;
    if (e) motors(e, k, command, command);
    for (int j = 0; j < N; j++) {
      double size = command[j] < 0.0 ? -command[j] : command[j];
      t->saturated[j] += size >= t->true_limit[j];
      acted[j] = clipped(command[j], t->true_limit[j]);
      force[6 + j] = acted[j];
    }
    if (resisted) {
      numbers_at(turn, t->v, t->true_parameters, numbers, w);
      if (open) settle(e, t->q, t->v, numbers, t->tick_s);
      resisted_step(e, k, t->stamp_ns, scheme, t->q, t->v, acted, t->true_parameters, &t->tick_s, numbers, q, v, w);
      open = e->n_wrenches > 0;
    } else {
      const double *arguments[ARGUMENTS] = {t->q, t->v, force, t->true_parameters, &t->tick_s, kept};
      double *results[ARGUMENTS] = {q, v};
      (prepared ? rests : schemes)[scheme](arguments, results, 0, w, 0);
    }
    for (int j = 0; j < N; j++) t->work += acted[j] * (q[7 + j] - t->q[7 + j]);
    memcpy(t->q, q, sizeof q), memcpy(t->v, v, sizeof v), memcpy(t->effort, acted, sizeof acted);
    t->stamp_ns += t->tick_ns;
  }
  if (open) {
    turns_at(t->q, turn);
    numbers_at(turn, t->v, t->true_parameters, numbers, w);
    settle(e, t->q, t->v, numbers, t->tick_s);
  }
  if (e) pass(e, steps < ticks ? steps : ticks);
}
