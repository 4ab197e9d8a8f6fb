/* Quiet reference periods: what simulation/loop.py does in each while nothing has to be decided. */

enum { HOLD = 0, JOINTS = 1, TOOL = 2, ON_DEPUTY = 3 }; /* how an arm is led, as in compiled/periods.py */

/* All fields have 8 bytes; compiled/periods.py has the same order. */
typedef struct {
  double starts[ARMS * POSE_ROW], goals[ARMS * POSE_ROW]; /* in world, of arms led by their tool */
  double in_deputy[ARMS * POSE];        /* the goals in the deputy, of arms led to it */
  double joints[N], ends[N];            /* rad, where the phase began and where it leads, of the others */
  double rates[N];                      /* rad/s of the reference of the period before */
  double in_tool[POSE];                 /* the deputy in the tool that holds it */
  double deputy[POSE_ROW];              /* its row: in world where nobody holds it, at the last period */
  double deputy_twist[TWIST];           /* at the last period */
  double damping, period_s;             /* of the generalised Jacobian; s */
  long long kind[ARMS], holder;         /* -1: nobody */
  long long failures, most_failures;    /* of inverse kinematics in a row; 0: any number */
  long long has_momentum;               /* whether the robot may have some, by a deputy with mass */
} quiet_t;

typedef struct {
  double reference[N], rates[N], targets[ARMS * POSE_ROW], tools[ARMS * POSE_ROW], deputy[POSE_ROW];
  double deputy_twist[TWIST];
  double conserved[10], work;           /* as in compiled/kinematics_functions.py; J */
  double lost, given[7], status;        /* as in effects_t, 0 without; -1: not asked */
} period_t;

/* Work out what the plant shows at the beginning of a period. */
void sms_observe(const ticks_t *t, void *of_periods, void *of_period, double *w) {
  quiet_t *quiet = of_periods;
  period_t *p = of_period;
  double twists[ARMS * TWIST];
  if (quiet->holder >= 0)
    sms_motion_rows(t->q, t->v, t->true_parameters, quiet->holder, quiet->in_tool, p->tools, twists, quiet->deputy,
                    quiet->deputy_twist, w);
  else
    sms_tool_rows(t->q, t->true_parameters, p->tools, w);
  memcpy(p->deputy, quiet->deputy, sizeof p->deputy);
  memcpy(p->deputy_twist, quiet->deputy_twist, sizeof p->deputy_twist);
  const double *arguments[ARGUMENTS] = {t->q, t->v, t->true_parameters};
  double *results[ARGUMENTS] = {p->conserved};
  sms_conserved(arguments, results, 0, w, 0);
  p->work = t->work;
  if (t->effects) {
    p->lost = t->effects->total_lost;
    memcpy(p->given, t->effects->total_given, sizeof p->given);
  }
}

/* Find targets, joints and rates of the reference, at a fraction of the motion and its rate. */
static void refer(const ticks_t *t, const ik_settings_t *settings, quiet_t *quiet, period_t *p, double fraction,
                  double rate, double *w) {
  double twists[ARMS * TWIST], q[NQ];
  long long led[ARMS];
  int any = 0, all = 1, moving = 0;
  for (int arm = 0; arm < ARMS; arm++) {
    int first = first_joint[arm];
    led[arm] = quiet->kind[arm] == TOOL || quiet->kind[arm] == ON_DEPUTY;
    if (led[arm]) {
      double *twist = twists + TWIST * arm;
      if (quiet->kind[arm] == ON_DEPUTY)
        placed(quiet->deputy, quiet->in_deputy + POSE * arm, quiet->goals + POSE_ROW * arm);
      any = 1;
      on_path(quiet->starts + POSE_ROW * arm, quiet->goals + POSE_ROW * arm, fraction, rate,
              p->targets + POSE_ROW * arm, twist);
    } else {
      all = 0;
    }
    for (int j = first; j < first + arm_joints[arm]; j++) {
      double way = quiet->ends[j] - quiet->joints[j];
      p->reference[j] = led[arm] ? t->q[7 + j] : quiet->joints[j];
      p->rates[j] = 0.0;
      if (quiet->kind[arm] == JOINTS) p->reference[j] = quiet->joints[j] + fraction * way, p->rates[j] = rate * way;
    }
  }
  if (any && quiet->has_momentum) sms_without_drift(t->q, t->v, t->known_parameters, led, twists, w);
  for (int i = 0; i < ARMS * TWIST; i++) moving |= led[i / TWIST] && twists[i] != 0.0;
  p->status = -1.0;
  if (any) {
    ik_solution_t solution;
    memcpy(solution.joints, p->reference, sizeof solution.joints);
    sms_find_joints(t->q, t->known_parameters, p->targets, led, settings, &solution, w);
    memcpy(p->reference, solution.joints, sizeof p->reference);
    p->status = (double)solution.status;
    quiet->failures = solution.status == CONVERGED ? 0 : quiet->failures + 1;
  }
  if (!all) {
    double rows[ARMS * POSE_ROW];
    memcpy(q, t->q, 7 * sizeof *q), memcpy(q + 7, p->reference, sizeof p->reference);
    sms_tool_rows(q, t->known_parameters, rows, w);
    for (int arm = 0; arm < ARMS; arm++)
      if (!led[arm]) memcpy(p->targets + POSE_ROW * arm, rows + POSE_ROW * arm, POSE_ROW * sizeof *rows);
  }
  if (moving) sms_resolve_rates(t->q, t->known_parameters, twists, led, &quiet->damping, p->rates, w);
}

/* Carry out at most `count` periods of `ticks` ticks each, with a fraction of the motion and its rate for each;
 * return how many, fewer after a last failure. */
long sms_periods(ticks_t *t, long scheme, const ik_settings_t *settings, quiet_t *quiet, const double *progress,
                 period_t *periods, double *rows, long count, long ticks, double *w) {
  for (long k = 0; k < count; k++, rows += ticks * (NQ + NV + 2 * N)) {
    period_t *p = periods + k;
    t->observe_truth(t, quiet, p, w);
    refer(t, settings, quiet, p, progress[2 * k], progress[2 * k + 1], w);
    for (int j = 0; j < N; j++) {
      t->motion[0][j] = p->reference[j], t->motion[1][j] = p->rates[j];
      t->motion[2][j] = (p->rates[j] - quiet->rates[j]) / quiet->period_s;
      quiet->rates[j] = p->rates[j];
    }
    t->reference_ns = t->stamp_ns;
    t->ticks_of_truth(t, scheme, rows, ticks, ticks, w);
    if (quiet->most_failures > 0 && quiet->failures >= quiet->most_failures) return k + 1;
  }
  return count;
}
