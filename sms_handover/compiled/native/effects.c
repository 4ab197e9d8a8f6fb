/* Effects of conditions that are not ideal: command, its way, motor, friction and wrenches, in this order.
 *
 * As plant/effects.py has them, whose random numbers it is given. Besides N, NQ and NV from here on
 *   NUMBERS, FACTORS  how many numbers of robot, H and c, and of the factors of H there are, as
 *                     compiled/resisted_functions.py has them
 *   DIAGONAL          where the diagonal of H is among the numbers, by joint
 *   HELD_STEPS        steps of the schemes from the first acceleration on
 */
#define NS_PER_S 1e9 /* [ns/s] */

typedef int (*function_t)(const double **, double **, casadi_int *, double *, int);

/* Kinds, as in compiled/wrench_table.py, and the numbers of each. */
enum {
  IN_WORLD = 0,      /* force, torque, point in the axes of the body (3 each) */
  IN_BODY = 1,       /* force, torque about its origin (3 each) */
  MISFIRE = 2,       /* the same, start s, end s */
  GRADIENT = 3,      /* radial, across (3 each), rate rad/s, 3 n^2 */
  RELATIVE = 4,      /* the same with n^2, reference (3) */
  TOLD_IN_WORLD = 5, /* none: force and torque are rows (6) of ticks */
  TOLD_IN_BODY = 6
};

/* All fields have 8 bytes; compiled/wrench_table.py has the same order. */
typedef struct {
  double numbers[11];
  const double *rows;
  long long kind;
} wrench_t;

/* As compiled/effects.py. */
typedef struct {
  double viscous[N], coulomb[N], excess[N], slowness[N]; /* N m s/rad; N m; stiction less coulomb; s/rad */
  double factor[N], offset[N];          /* of the motors: 1 + gain; N m */
  double step[N], divisor[N];           /* N m, 0 for none; the same, but 1 for none */
  double held[N];                       /* N m, the command that the motors have */
  double companion[7];                  /* mass kg (0: none), centre of mass and velocity at the tick */
  double lost, given[7];                /* J; linear and angular impulse and work, in the latest tick */
  double total_lost, total_given[7];    /* the same since the start */
  double start[26];                     /* of the latest tick, for its account */
  const double *noise;                  /* N m, of each tick */
  const long long *dropped;             /* whether the command of each tick gets lost */
  double *waiting;                      /* commands on their way, from `oldest` on round to it */
  wrench_t *wrenches;
  long long delay, oldest, n_wrenches;
  long long has_friction, has_path, has_motor;
} effects_t;

/* Whether something acts beside the motors. */
static int resists(const effects_t *e) { return e && (e->has_friction || e->n_wrenches > 0); }

SMS_INLINE double clipped(double value, double limit) {
  if (value < -limit) return -limit;
  if (value > limit) return limit;
  return value; /* NaN too, as in NumPy */
}

static const int diagonal[N] = DIAGONAL;

SMS_INLINE double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

SMS_INLINE void add_cross(const double *a, const double *b, double *sum) {
  sum[0] += a[1] * b[2] - a[2] * b[1];
  sum[1] += a[2] * b[0] - a[0] * b[2];
  sum[2] += a[0] * b[1] - a[1] * b[0];
}

SMS_INLINE void turned(const double *R, const double *x, double *y) {
  for (int i = 0; i < 3; i++) y[i] = dot(R + 3 * i, x);
}

SMS_INLINE void turned_back(const double *R, const double *x, double *y) {
  for (int i = 0; i < 3; i++) y[i] = R[i] * x[0] + R[3 + i] * x[1] + R[6 + i] * x[2];
}

/* Go on to the numbers of later ticks. */
static void pass(effects_t *e, long ticks) {
  e->noise += N * ticks, e->dropped += ticks;
  for (int k = 0; k < e->n_wrenches; k++)
    if (e->wrenches[k].kind >= TOLD_IN_WORLD) e->wrenches[k].rows += 6 * ticks;
}

/* What a command is on its way, and what the motors make of it. */
static void motors(effects_t *e, long tick, const double *command, double *torque) {
  double arrived[N];
  memcpy(arrived, command, sizeof arrived);
  if (e->has_path) {
    if (e->delay) {
      double *slot = e->waiting + N * e->oldest;
      memcpy(arrived, slot, sizeof arrived), memcpy(slot, command, sizeof arrived);
      e->oldest = (e->oldest + 1) % e->delay;
    }
    if (e->dropped[tick]) memcpy(arrived, e->held, sizeof arrived);
    memcpy(e->held, arrived, sizeof arrived);
  }
  memcpy(torque, arrived, sizeof arrived);
  if (!e->has_motor) return;
  const double *noise = e->noise + N * tick;
  for (int j = 0; j < N; j++) {
    double rounded = e->divisor[j] * rint(arrived[j] / e->divisor[j]);
    arrived[j] = e->step[j] > 0.0 ? rounded : arrived[j];
  }
  for (int j = 0; j < N; j++) torque[j] = e->factor[j] * arrived[j] + e->offset[j] + noise[j];
}

/* Direction from the Earth in the middle of a tick, by radial, across and rate. */
static void direction(const double *orbit, double middle_s, double *r) {
  double angle = orbit[6] * middle_s, c = cos(angle), s = sin(angle);
  for (int i = 0; i < 3; i++) r[i] = c * orbit[i] + s * orbit[3 + i];
}

/* 3 n^2 r x (I r) in axes of the body, I about the centre of mass c: I r = I_o r - m (c.c r - c.r c). */
static void gradient(const double *body, const double *c, const double *r, double rate, double *torque) {
  const double *I = body + 4;
  double square = dot(c, c), along = dot(c, r), own[3], moment[3] = {0.0};
  own[0] = I[0] * r[0] + I[1] * r[1] + I[2] * r[2];
  own[1] = I[1] * r[0] + I[3] * r[1] + I[4] * r[2];
  own[2] = I[2] * r[0] + I[4] * r[1] + I[5] * r[2];
  for (int i = 0; i < 3; i++) own[i] -= body[0] * (square * r[i] - along * c[i]);
  add_cross(r, own, moment);
  for (int i = 0; i < 3; i++) torque[i] = rate * moment[i];
}

/* The sum (6) of the wrenches over a tick in axes of world, on the robot as one `body` at a place and rotation. */
static void sum_wrenches(const effects_t *e, long tick, double start_s, double h, const double *place,
                         const double *R, const double *body, double *sum) {
  double mass = body[0], c[3] = {body[1] / mass, body[2] / mass, body[3] / mass};
  for (int i = 0; i < 6; i++) sum[i] = 0.0;
  for (int k = 0; k < e->n_wrenches; k++) {
    const wrench_t *by = e->wrenches + k;
    const double *number = by->numbers, *row = by->rows + 6 * tick;
    double one[6] = {0.0}, part[6], lever[3], r[3], r_in_body[3], share = 1.0;
    switch (by->kind) {
    case IN_WORLD:
      turned(R, number + 6, lever);
      memcpy(one, number, sizeof one);
      add_cross(lever, one, one + 3);
      break;
    case TOLD_IN_WORLD:
      memcpy(one, row, sizeof one);
      break;
    case GRADIENT:
      direction(number, start_s + 0.5 * h, r);
      turned_back(R, r, r_in_body);
      gradient(body, c, r_in_body, number[7], part);
      turned(R, part, one + 3);
      break;
    case RELATIVE: /* m n^2 (3 r r^T - 1) x at the centre of mass */
      direction(number, start_s + 0.5 * h, r);
      turned(R, c, lever);
      for (int i = 0; i < 3; i++) part[i] = place[i] + lever[i] - number[8 + i];
      for (int i = 0; i < 3; i++) one[i] = mass * number[7] * (3.0 * dot(r, part) * r[i] - part[i]);
      add_cross(lever, one, one + 3);
      break;
    case MISFIRE: {
      double from = start_s > number[6] ? start_s : number[6], to = start_s + h < number[7] ? start_s + h : number[7];
      share = to > from ? (to - from) / h : 0.0;
    } /* fall through */
    default: /* in axes of the body */
      for (int i = 0; i < 6; i++) part[i] = share * (by->kind == TOLD_IN_BODY ? row : number)[i];
      turned(R, part, one), turned(R, part + 3, one + 3);
    }
    for (int i = 0; i < 6; i++) sum[i] += one[i];
  }
}

/* Friction over a tick of h s under a force (6 + n), and v' with it.
 *
 * As plant/joint_friction.py. Pivoting changes all joints at once that are on a wrong side, which takes a pass or
 * two; where that does not end, the first of them alone, which does [Judice1992].
 */
static void resist(const effects_t *e, const double *numbers, const double *v, double h, const double *force,
                   double *acceleration, double *friction, double *w) {
  enum { TRIES = 3, MOST = 50 * N };
  const double rounding = 8.0 * 2.220446049250313e-16;
  const double *bias = numbers + NUMBERS - N;
  double added[N], bound[N], free[N], given[N], holding[N], right[NV], factors[FACTORS];
  int side[N], fewest = N + 1, tries = TRIES, changed = 1; /* way in which a joint slips, 0: it sticks */
  for (int j = 0; j < N; j++) {
    double x = v[6 + j] * e->slowness[j];
    bound[j] = e->coulomb[j] + e->excess[j] * sms_exp(-(x * x));
  }
  for (int j = 0; j < N; j++) added[j] = h * e->viscous[j];
  for (int j = 0; j < N; j++) {
    /* a guess, as if the others stood still: a good one saves passes and changes nothing else */
    double inertia = numbers[diagonal[j]], reached = v[6 + j] * inertia + h * (force[6 + j] - bias[j]);
    side[j] = fabs(reached) <= h * bound[j] && bound[j] > 0.0 ? 0 : reached < 0.0 ? -1 : 1;
  }
  memcpy(right, force, 6 * sizeof *right);
  for (int pass = 0; pass < MOST; pass++) {
    for (int j = 0; j < N; j++) {
      free[j] = side[j] ? 1.0 : 0.0;
      given[j] = side[j] ? 0.0 : -v[6 + j] / h;
      right[6 + j] = force[6 + j] - e->viscous[j] * v[6 + j] - side[j] * bound[j];
    }
    if (changed) {
      const double *arguments[ARGUMENTS] = {numbers, added, free};
      double *results[ARGUMENTS] = {factors};
      sms_factors(arguments, results, 0, w, 0);
    }
    const double *arguments[ARGUMENTS] = {numbers, factors, right, given};
    double *results[ARGUMENTS] = {acceleration, holding};
    sms_held(arguments, results, 0, w, 0);
    int better[N], wrong = 0, first = -1;
    for (int j = 0; j < N; j++) {
      double change = h * acceleration[6 + j], end = v[6 + j] + change;
      better[j] = side[j];
      if (bound[j] > 0.0 && side[j] && side[j] * end < -rounding * (fabs(v[6 + j]) + fabs(change)))
        better[j] = fabs(end) * numbers[diagonal[j]] > 2.0 * h * bound[j] && tries ? -side[j] : 0;
      else if (!side[j] && fabs(holding[j]) > bound[j] * (1.0 + rounding))
        better[j] = holding[j] > 0.0 ? -1 : 1;
      if (better[j] != side[j] && !wrong++) first = j;
    }
    if (!wrong) break;
    if (wrong < fewest) fewest = wrong, tries = TRIES;
    else if (tries) tries--;
    changed = 0;
    for (int j = tries ? 0 : first; j < (tries ? N : first + 1); j++) {
      changed |= (better[j] == 0) != (side[j] == 0);
      side[j] = better[j];
    }
  }
  for (int j = 0; j < N; j++) {
    double dry = side[j] ? -side[j] * bound[j] : clipped(holding[j], bound[j]);
    friction[j] = dry - e->viscous[j] * (v[6 + j] + h * acceleration[6 + j]);
  }
}

/* What the account of a tick needs of one of its ends (12): the lever of the base's origin about the centre of
 * mass of the robot and its rate, the velocity of that centre, and the angular velocity of the base, in world. */
static void end_of(const double *numbers, const double *v, const double *R, double *end) {
  double mass = numbers[0], arm[3], moving[3], origin[3];
  for (int i = 0; i < 3; i++) arm[i] = -numbers[1 + i] / mass, moving[i] = numbers[10 + i] / mass;
  turned(R, arm, end), turned(R, moving, end + 6), turned(R, v, origin), turned(R, v + 3, end + 9);
  for (int i = 0; i < 3; i++) end[3 + i] = origin[i] - end[6 + i];
}

enum { END = 12, FORCE_AT = 12, TORQUE_AT = 15, PLACE_AT = 18, TURN_AT = 21, MASS_AT = 25 };

/* A step under friction and wrenches, from `numbers` of its start on; `effort` is that of the motors. */
static void resisted_step(effects_t *e, long tick, long long stamp_ns, long scheme, const double *q, const double *v,
                          const double *effort, const double *parameters, const double *h,
                          const double *numbers, double *q_next, double *v_next, double *w) {
  static const function_t schemes[] = HELD_STEPS;
  double force[NV] = {0.0}, acceleration[NV], friction[N], body[POSE], sum[6];
  memcpy(force + 6, effort, N * sizeof *effort);
  if (e->n_wrenches) {
    double *start = e->start;
    pose_of(q, body);
    sum_wrenches(e, tick, (double)stamp_ns / NS_PER_S, *h, q, body, numbers, sum);
    turned_back(body, sum, force), turned_back(body, sum + 3, force + 3);
    end_of(numbers, v, body, start);
    memcpy(start + FORCE_AT, sum, sizeof sum), memcpy(start + PLACE_AT, q, 7 * sizeof *q);
    start[MASS_AT] = numbers[0];
  }
  resist(e, numbers, v, *h, force, acceleration, friction, w);
  for (int j = 0; j < N; j++) force[6 + j] += friction[j];
  const double *arguments[ARGUMENTS] = {q, v, force, parameters, h, acceleration};
  double *results[ARGUMENTS] = {q_next, v_next};
  schemes[scheme](arguments, results, 0, w, 0);
  e->lost = 0.0;
  for (int j = 0; j < N; j++) e->lost -= friction[j] * (q_next[7 + j] - q[7 + j]);
  e->total_lost += e->lost;
}

/* Lever and its rate about the centre of mass of the robot and of what floats beside it. */
static void with_companion(const effects_t *e, const double *place, double mass, double after, double *end) {
  double theirs = e->companion[0], share = theirs / (mass + theirs);
  for (int i = 0; i < 3; i++) {
    double moving = e->companion[4 + i], away = place[i] - end[i] - (e->companion[1 + i] + after * moving);
    end[i] += share * away, end[3 + i] += share * (end[6 + i] - moving);
  }
}

/* Integral over h s of what has these values and rates at the ends, exact to order 4. */
SMS_INLINE double integral(double h, const double *first, const double *last, int i) {
  return 0.5 * h * (first[i] + last[i]) + h * h / 12.0 * (first[3 + i] - last[3 + i]);
}

/* Book what wrenches have given in the latest step, with `numbers` of its end.
 *
 * As plant/external_wrenches.py, but for the integral of the angular velocity, which is that of a turn theta to
 * the order 4 by Magnus [Blanes2009]: int w dt = theta + h^2 / 12 w_0 x w_1.
 */
static void settle(effects_t *e, const double *q, const double *v, const double *numbers, double h) {
  double R[POSE], end[END], *start = e->start;
  const double *F = start + FORCE_AT, *T = start + TORQUE_AT, *place = start + PLACE_AT, *a = start + TURN_AT;
  pose_of(q, R);
  end_of(numbers, v, R, end);
  if (e->companion[0] > 0.0) {
    with_companion(e, place, start[MASS_AT], 0.0, start);
    with_companion(e, q, numbers[0], h, end);
  }
  const double *b = q + 3;
  double lever[3], way[3], sine[3] = {a[3] * b[0], a[3] * b[1], a[3] * b[2]};
  for (int i = 0; i < 3; i++) lever[i] = integral(h, start, end, i), sine[i] -= b[3] * a[i];
  add_cross(a, b, sine); /* imaginary part of b a^-1 is a_w b - b_w a + a x b */
  double cosine = a[3] * b[3] + dot(a, b), square = dot(sine, sine), twice = 2.0;
  if (square > 1e-4) /* below, terms of a series leave less than rounding */
    twice = 2.0 * atan2(sqrt(square), fabs(cosine)) / sqrt(square);
  else
    twice = 2.0 * (1.0 + square * (1.0 / 6.0 + square * (3.0 / 40.0 + square * (15.0 / 336.0 + square * 105.0 / 3456.0))));
  if (cosine < 0.0) twice = -twice;
  for (int i = 0; i < 3; i++) way[i] = 0.0;
  add_cross(start + 9, end + 9, way);
  double *given = e->given, work = 0.0;
  for (int i = 0; i < 3; i++) {
    given[i] = h * F[i], given[3 + i] = h * T[i];
    way[i] = twice * sine[i] + h * h / 12.0 * way[i];
    work += F[i] * (q[i] - place[i]) + T[i] * way[i];
  }
  add_cross(lever, F, given + 3);
  given[6] = work;
  for (int i = 0; i < 7; i++) e->total_given[i] += given[i];
}

/* Cosines and sines of the joint angles. */
static void turns_at(const double *q, double (*turn)[N]) {
  for (int j = 0; j < N; j++) turn[0][j] = cos(q[7 + j]);
  for (int j = 0; j < N; j++) turn[1][j] = sin(q[7 + j]);
}

static void numbers_at(double (*turn)[N], const double *v, const double *parameters, double *numbers, double *w) {
  const double *arguments[ARGUMENTS] = {turn[0], turn[1], v, parameters};
  double *results[ARGUMENTS] = {numbers};
  sms_inertia(arguments, results, 0, w, 0);
}

/* A step that is called by Python, and its account. */
void sms_resisted_step(effects_t *e, long stamp_ns, long scheme, const double *q, const double *v, const double *effort,
                       const double *parameters, const double *h, double *q_next, double *v_next, double *w) {
  double numbers[NUMBERS], turn[2][N];
  turns_at(q, turn);
  numbers_at(turn, v, parameters, numbers, w);
  resisted_step(e, 0, stamp_ns, scheme, q, v, effort, parameters, h, numbers, q_next, v_next, w);
}

void sms_settle(effects_t *e, const double *q, const double *v, const double *parameters, const double *h,
                double *w) {
  double numbers[NUMBERS], turn[2][N];
  turns_at(q, turn);
  numbers_at(turn, v, parameters, numbers, w);
  settle(e, q, v, numbers, *h);
}
